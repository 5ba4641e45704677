/*
 * outline.c - texel outlines in the source picture (outline.h).
 *
 * Two ways to the same points: in general every corner goes destination -> direction -> source;
 * where a grid about the plane's normal is filled from a disc about the same axis (the
 * usual probe) a line of constant polar angle is a circle of one radius, and columns are radii.
 */
#include "outline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FLATNESS OUTLINE_FLATNESS
/* In a grid's rows next to a pole, where a straight edge of the sphere is bent most and all pixels of a row
 * lie within one texel: a chord's sagitta there is light of a whole row. */
#define POLAR       8 /* rows */
#define FLAT_POLAR  0.002
#define SHORT_POLAR 0.25
#define MAX_DEPTH   10
#define WIDEST                                                                                               \
    (5 * M_PI /                                                                                              \
     180) /* of longitude that one chord spans, however small the texel: .13 % of the area about a pole */

typedef struct line {
    double *xy; /* points, corners and what refines the edges between them */
    int n, room;
    int *start;   /* corner k is point start[k] */
    char *inside; /* corner k lies within the source's field */
    char *meets;  /* the edge that ends at corner k (a side: the one at k) has a point within it between its
                     ends */
} line;

struct outliner {
    const chart *dst, *src;
    int sense;
    double period;        /* of x in the source; 0 for a disc */
    double pole[2];       /* a grid's y of its upper and lower pole */
    int concentric, fine; /* fine: pieces per edge in the table below */
    double *circle;       /* concentric: unit vectors, width*fine + 1 */
    line top, bottom, side;
    double widest; /* columns that one chord may span */
    int axis[2];   /* texel that holds the source's axis */
    int met;       /* a point that refine() tried lay within the field */
    int ready;     /* row, or -1 */
    double *poly;
    int npoly, poly_room;
};

static int push(line *l, const double p[2])
{
    if (l->n == l->room) {
        int room = l->room ? 2 * l->room : 1024;
        double *q = realloc(l->xy, sizeof(double) * 2 * (size_t)room);
        if (!q) return -1;
        l->xy = q, l->room = room;
    }
    l->xy[2 * l->n] = p[0], l->xy[2 * l->n + 1] = p[1];
    l->n++;
    return 0;
}

static double det3(const double m[3][3])
{
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

static int same_axis(const chart *a, const chart *b)
{
    double d = 0;
    for (int k = 0; k < 3; k++) d += fabs(a->frame[2][k] - b->frame[2][k]);
    return d < 1e-14;
}

/* Number of chords (a power of 2) that keep an arc of angle step at radius r flat, and its area. */
static int chords(double r, double step)
{
    int m = 1;
    while (m < 1024 && (r * (1 - cos(step / (2 * m))) > FLATNESS || step / m > WIDEST)) m *= 2;
    return m;
}

static int line_init(line *l, int corners)
{
    l->start = malloc(sizeof(int) * (size_t)corners);
    l->inside = malloc((size_t)corners);
    l->meets = calloc((size_t)corners, 1);
    return l->start && l->inside && l->meets ? 0 : -1;
}

outliner *outliner_new(const chart *dst, const chart *src)
{
    outliner *o = calloc(1, sizeof *o);
    if (!o) return NULL;
    o->dst = dst, o->src = src;
    o->ready = -1;
    o->sense = det3(dst->frame) * det3(src->frame) > 0 ? 1 : -1;
    o->widest = dst->kind == CHART_GRID ? WIDEST * dst->width / dst->lon_span : INFINITY;
    if (src->kind == CHART_GRID) {
        o->period = 2 * M_PI * src->width / src->lon_span;
        for (int k = 0; k < 2; k++) o->pole[k] = chart_pole(src, k);
    }
    o->concentric = dst->kind == CHART_GRID && src->kind == CHART_DISC && same_axis(dst, src);
    if (line_init(&o->top, dst->width + 1) || line_init(&o->bottom, dst->width + 1) ||
        line_init(&o->side, dst->width + 2))
        goto fail;
    double axis[2];
    int seen = chart_project(axis, dst, src->frame[2]);
    for (int k = 0; k < 2; k++) {
        int last = (k ? dst->height : dst->width) - 1;
        o->axis[k] = !seen || !(axis[k] >= 0) ? -1 : axis[k] <= last ? (int)axis[k] : last;
    }
    if (o->concentric) {
        double step = dst->lon_span / dst->width;
        o->fine = chords(src->radius * fmax(hypot(src->shape[0][0], src->shape[1][0]),
                                            hypot(src->shape[0][1], src->shape[1][1])),
                         step);
        size_t n = (size_t)dst->width * (size_t)o->fine + 1;
        o->circle = malloc(2 * n * sizeof(double));
        if (!o->circle) goto fail;
        for (size_t k = 0; k < n; k++) {
            double lon = dst->lon0 + step * (double)k / o->fine, d[3];
            for (int i = 0; i < 3; i++) d[i] = cos(lon) * dst->frame[0][i] + sin(lon) * dst->frame[1][i];
            double px = d[0] * src->frame[0][0] + d[1] * src->frame[0][1] + d[2] * src->frame[0][2];
            double py = d[0] * src->frame[1][0] + d[1] * src->frame[1][1] + d[2] * src->frame[1][2];
            o->circle[2 * k] = src->shape[0][0] * px + src->shape[0][1] * py;
            o->circle[2 * k + 1] = -(src->shape[1][0] * px + src->shape[1][1] * py);
        }
    }
    return o;
fail:
    outliner_free(o);
    return NULL;
}

void outliner_free(outliner *o)
{
    if (!o) return;
    line *const l[] = {&o->top, &o->bottom, &o->side};
    for (int k = 0; k < 3; k++) {
        free(l[k]->xy);
        free(l[k]->start);
        free(l[k]->inside);
        free(l[k]->meets);
    }
    free(o->circle);
    free(o->poly);
    free(o);
}

static int at(double p[2], const outliner *o, double x, double y)
{
    double d[3];
    chart_unproject(d, o->dst, x, y);
    return chart_project(p, o->src, d);
}

static double near(const outliner *o, double dx)
{
    return o->period > 0 ? dx - o->period * nearbyint(dx / o->period) : dx;
}

/* Points between the ends a and b of an edge, as many as flatness needs. */
static int refine(outliner *o, line *l, const double a[2], const double pa[2], const double b[2],
                  const double pb[2], int depth)
{
    double dx = near(o, pb[0] - pa[0]), dy = pb[1] - pa[1];
    int wide = fabs(b[0] - a[0]) > o->widest;
    const int polar =
        o->period > 0 && (fmin(pa[1], pb[1]) < o->pole[0] + POLAR || fmax(pa[1], pb[1]) > o->pole[1] - POLAR);
    const double flat = polar ? FLAT_POLAR : FLATNESS;
    if ((dx * dx + dy * dy < (polar ? SHORT_POLAR * SHORT_POLAR : 1) && !wide) || depth == 0) return 0;
    double m[2] = {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])}, pm[2];
    o->met |= at(pm, o, m[0], m[1]);
    double ex = near(o, pm[0] - pa[0]) - 0.5 * dx, ey = pm[1] - pa[1] - 0.5 * dy;
    if (ex * ex + ey * ey < flat * flat && !wide) return 0;
    return refine(o, l, a, pa, m, pm, depth - 1) || push(l, pm) || refine(o, l, m, pm, b, pb, depth - 1);
}

static int make_line(outliner *o, line *l, int y)
{
    int w = o->dst->width;
    l->n = 0;
    if (o->concentric) {
        double theta = o->dst->polar_min + y * chart_row_step(o->dst);
        double r = o->src->radius * lens_radius(NULL, &o->src->lens, theta);
        int m = chords(r, o->dst->lon_span / w), stride = o->fine / m, n = w * m;
        memset(l->inside, theta <= o->src->lens.half, (size_t)w + 1);
        for (int k = 0; k <= n; k++) {
            const double *c = o->circle + 2 * (size_t)k * (size_t)stride;
            double p[2] = {o->src->cx + r * c[0], o->src->cy + r * c[1]};
            if (push(l, p)) return -1;
        }
        for (int x = 0; x <= w; x++) l->start[x] = x * m;
        return 0;
    }
    double a[2] = {0, y}, pa[2];
    for (int x = 0; x <= w; x++) {
        double b[2] = {x, y}, pb[2];
        char in = (char)at(pb, o, x, y);
        o->met = 0;
        if (x && refine(o, l, a, pa, b, pb, MAX_DEPTH)) return -1;
        l->start[x] = l->n;
        l->inside[x] = in;
        l->meets[x] = (char)o->met;
        if (push(l, pb)) return -1;
        memcpy(a, b, sizeof a);
        memcpy(pa, pb, sizeof pa);
    }
    return 0;
}

/* Points inside the column edges between the ready row's two lines. */
static int make_sides(outliner *o, int y)
{
    line *l = &o->side;
    l->n = 0;
    for (int x = 0; x <= o->dst->width; x++) {
        l->start[x] = l->n;
        if (o->concentric) continue;
        const double a[2] = {x, y}, b[2] = {x, y + 1};
        o->met = 0;
        if (refine(o, l, a, o->top.xy + 2 * o->top.start[x], b, o->bottom.xy + 2 * o->bottom.start[x],
                   MAX_DEPTH))
            return -1;
        l->meets[x] = (char)o->met;
    }
    l->start[o->dst->width + 1] = l->n;
    return 0;
}

int outliner_row(outliner *o, int y)
{
    if (o->ready >= 0 && y == o->ready + 1) {
        line t = o->top;
        o->top = o->bottom;
        o->bottom = t;
    } else if (make_line(o, &o->top, y)) {
        return -1;
    }
    if (make_line(o, &o->bottom, y + 1) || make_sides(o, y)) return -1;
    o->ready = y;
    return 0;
}

static inline int add(outliner *o, double x, double y)
{
    if (o->npoly == o->poly_room) {
        int room = o->poly_room ? 2 * o->poly_room : 256;
        double *q = realloc(o->poly, sizeof(double) * 2 * (size_t)room);
        if (!q) return -1;
        o->poly = q, o->poly_room = room;
    }
    if (o->period > 0 && o->npoly) { /* continuous in x */
        double last = o->poly[2 * o->npoly - 2];
        x = last + near(o, x - last);
    }
    o->poly[2 * o->npoly] = x, o->poly[2 * o->npoly + 1] = y;
    o->npoly++;
    return 0;
}

static int add_run(outliner *o, const line *l, int from, int to)
{
    int step = from <= to ? 1 : -1;
    for (int k = from; k != to + step; k += step)
        if (add(o, l->xy[2 * k], l->xy[2 * k + 1])) return -1;
    return 0;
}

/* A contour around a pole of the grid does not close: it goes home along the pole. */
static int close_over_pole(outliner *o)
{
    double first = o->poly[0], last = o->poly[2 * o->npoly - 2], mean = 0;
    double gap = last + near(o, first - last) - first;
    if (fabs(gap) < 0.5 * o->period) return 0;
    for (int k = 0; k < o->npoly; k++) mean += o->poly[2 * k + 1] / o->npoly;
    double pole = o->pole[mean > (o->pole[0] + o->pole[1]) / 2];
    if (add(o, first + gap, o->poly[1]) || add(o, first + gap, pole) || add(o, first + gap, pole)) return -1;
    o->poly[2 * o->npoly - 2] = first; /* a whole period back, along the pole */
    return 0;
}

int outliner_sense(const outliner *o)
{
    return o->sense;
}

int outliner_inside(const outliner *o, int x)
{
    return o->top.inside[x] & o->top.inside[x + 1] & o->bottom.inside[x] & o->bottom.inside[x + 1];
}

/* Does the source's field reach into texel x?  A corner may lie in it, an edge may cross it, or the texel may
 * hold all of it. */
static int reaches(const outliner *o, int x)
{
    const line *t = &o->top, *b = &o->bottom, *s = &o->side;
    return t->inside[x] | t->inside[x + 1] | b->inside[x] | b->inside[x + 1] | t->meets[x + 1] |
           b->meets[x + 1] | s->meets[x] | s->meets[x + 1] | (x == o->axis[0] && o->ready == o->axis[1]);
}

/* The period in which the contour lies in the picture, as far as it does: a picture of part of the longitudes
 * has one such. */
static void into_the_picture(outliner *o)
{
    double lo = INFINITY, hi = -INFINITY;
    for (int k = 0; k < o->npoly; k++) lo = fmin(lo, o->poly[2 * k]), hi = fmax(hi, o->poly[2 * k]);
    double shift = o->period * nearbyint((0.5 * (lo + hi) - 0.5 * o->src->width) / o->period);
    for (int k = 0; shift != 0 && k < o->npoly; k++) o->poly[2 * k] -= shift;
}

int outliner_texel(const double **xy, int *n, outliner *o, int x)
{
    const line *t = &o->top, *b = &o->bottom, *s = &o->side;
    if (!reaches(o, x)) return 0;
    o->npoly = 0;
    if (add_run(o, t, t->start[x], t->start[x + 1])) return -1;
    if (s->start[x + 1] < s->start[x + 2] && add_run(o, s, s->start[x + 1], s->start[x + 2] - 1)) return -1;
    if (add_run(o, b, b->start[x + 1], b->start[x])) return -1;
    if (s->start[x] < s->start[x + 1] && add_run(o, s, s->start[x + 1] - 1, s->start[x])) return -1;
    if (o->period > 0) {
        if (close_over_pole(o)) return -1;
        into_the_picture(o);
    }
    *xy = o->poly;
    *n = o->npoly;
    return 1;
}
