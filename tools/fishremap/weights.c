/*
 * weights.c - which source pixels a destination texel covers, and with what solid angle (weights.h).
 *
 * For texel t and source pixel p:  w = overlap area x (solid angle per area at p), and
 *   out(t) = sum_p w (L_p + g_p . c_tp) / sum_p w,   c_tp the overlap's centroid about p's centre;
 * the sum of w over t is p's solid angle, so sum_t out(t) Omega(t) = sum_p L_p Omega(p).
 */
#include "weights.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TABLE 16384

/* Solid angle per area of picture (radius 1) at r.  The orthographic lens's 1/cos has no bound at the rim of
 * 180 degrees, though its integral has: there the mean over the ring that a pixel of half width d reaches. */
static double per_area_at(const lens *l, double r, double d)
{
    if (l->kind != LENS_ORTHOGRAPHIC) return lens_solid_angle(l, r);
    const double r0 = fmax(fmin(r, 1) - d, 0), r1 = fmin(r + d, 1), a = lens_angle(l, r0),
                 b = lens_angle(l, r1);
    return 4 * sin((a + b) / 2) * sin((b - a) / 2) / (r1 * r1 - r0 * r0);
}

int geometry_init(geometry *g, const chart *dst, const chart *src, const unsigned char *skip, errmsg *e)
{
    memset(g, 0, sizeof *g);
    g->dst = dst, g->src = src, g->skip = skip;
    int w = src->width, h = src->height;
    if (src->kind == CHART_GRID) {
        g->per_area = malloc(2 * sizeof(float) * (size_t)h);
        if (!g->per_area) return err_set(e, "out of memory");
        g->per_area_grows = g->per_area + h;
        double step = chart_row_step(src), wide = src->lon_span / w;
        for (int y = 0; y < h; y++) {
            g->per_area[y] = (float)chart_pixel_solid_angle(src, 0, y);
            g->per_area_grows[y] = (float)(wide * step * step * cos(src->polar_min + step * (y + 0.5)));
        }
        g->whole = chart_whole(src);
        return 0;
    }
    float *table = malloc(sizeof(float) * (TABLE + 2));
    g->per_area = malloc(sizeof(float) * (size_t)w * (size_t)h);
    if (!table || !g->per_area) {
        free(table);
        free(g->per_area);
        return err_set(e, "out of memory");
    }
    for (int k = 0; k <= TABLE + 1; k++)
        table[k] =
            (float)(per_area_at(&src->lens, (double)k / TABLE, 0.5 / src->radius) / chart_disc_scale(src));
    const float scale = (float)(TABLE / src->radius), a00 = (float)src->unshape[0][0] * scale,
                a01 = (float)src->unshape[0][1] * scale, a10 = (float)src->unshape[1][0] * scale,
                a11 = (float)src->unshape[1][1] * scale;
    const float limit = (float)TABLE + (float)M_SQRT1_2 * fmaxf(hypotf(a00, a10), hypotf(a01, a11));
#pragma omp parallel for schedule(static)
    for (int y = 0; y < h; y++) {
        float *q = g->per_area + (size_t)y * (size_t)w;
        float dy = (float)(src->cy - y - 0.5), x0 = (float)(0.5 - src->cx);
        for (int x = 0; x < w; x++) {
            float dx = x0 + (float)x, px = a00 * dx + a01 * dy, py = a10 * dx + a11 * dy;
            float r = sqrtf(px * px + py * py), k = fminf(r, TABLE);
            int i = (int)k;
            q[x] = r > limit ? 0 : table[i] + (k - (float)i) * (table[i + 1] - table[i]);
        }
    }
    free(table);
    return 0;
}

void bench_free(bench *b)
{
    outliner_free(b->lines);
    overlap_free(b->cells);
    free(b->span);
    free(b->rim);
    free(b->copy);
}

int bench_init(bench *b, const geometry *g)
{
    memset(b, 0, sizeof *b);
    b->lines = outliner_new(g->dst, g->src);
    b->cells = overlap_new();
    if (!b->lines || !b->cells) return -1;
    if (g->src->kind == CHART_DISC) {
        b->nrim = 4096;
        b->rim = malloc(sizeof(double) * 2 * (size_t)b->nrim);
        if (!b->rim) return -1;
        double step = outliner_sense(b->lines) * 2 * M_PI / b->nrim;
        const double(*s)[2] = g->src->shape, r = g->src->radius;
        for (int k = 0; k < b->nrim; k++) {
            double px = cos(k * step), py = -sin(k * step);
            b->rim[2 * k] = g->src->cx + r * (s[0][0] * px + s[0][1] * py);
            b->rim[2 * k + 1] = g->src->cy - r * (s[1][0] * px + s[1][1] * py);
        }
    }
    return 0;
}

static double twice_area(const double *xy, int n)
{
    double s = 0, x0 = xy[0], y0 = xy[1];
    for (int i = 1; i + 1 < n; i++)
        s += (xy[2 * i] - x0) * (xy[2 * i + 3] - y0) - (xy[2 * i + 2] - x0) * (xy[2 * i + 1] - y0);
    return s;
}

static void bounds(double box[4], const double *xy, int n)
{
    box[0] = box[2] = xy[0], box[1] = box[3] = xy[1];
    for (int i = 1; i < n; i++) {
        box[0] = fmin(box[0], xy[2 * i]), box[2] = fmax(box[2], xy[2 * i]);
        box[1] = fmin(box[1], xy[2 * i + 1]), box[3] = fmax(box[3], xy[2 * i + 1]);
    }
}

static int clamp_int(double v, int lo, int hi)
{
    return v < lo ? lo : v > hi ? hi : (int)v;
}

static int row_push(row *r, uint32_t px, double w, double wx, double wy)
{
    if (r->n == r->room) {
        size_t room = r->room ? 2 * r->room : 4096;
        entry *q = realloc(r->e, room * sizeof *q);
        if (!q) return -1;
        r->e = q, r->room = room;
    }
    r->e[r->n++] = (entry){px, (float)w, (float)wx, (float)wy};
    return 0;
}

/* Overlaps of the contour begun in b->cells, those above `least` pixels, become entries; *total gets the
 * solid angle, *hidden that of the pixels that don't count. */
static int collect(double *total, double *hidden, row *r, bench *b, const geometry *g, int x0, int y0, int x1,
                   int y1, int sense, double least)
{
    const chart *s = g->src;
    size_t w = (size_t)(x1 - x0);
    if (w > b->span_room) {
        free(b->span);
        b->span = malloc(w * sizeof *b->span);
        b->span_room = b->span ? w : 0;
        if (!b->span) return -1;
    }
    for (int y = y0; y < y1; y++) {
        int from, to = overlap_row(b->span, &from, b->cells, y);
        for (int x = from; x < to; x++) {
            const overlap_cell *c = b->span + (x - from);
            double area = sense * c->area;
            if (area < least) continue;
            int px = x;
            if (s->kind == CHART_GRID) px = ((x % s->width) + s->width) % s->width;
            size_t at = (size_t)y * (size_t)s->width + (size_t)px;
            double j = g->per_area[s->kind == CHART_GRID ? (size_t)y : at];
            if (j <= 0) continue;
            double weight = area * j; /* the mean of the solid angle per area over this piece: towards a pole
                                         it falls to 0 within a pixel */
            if (s->kind == CHART_GRID)
                weight = fmax(weight + sense * c->my * (double)g->per_area_grows[y], 0);
            if (g->skip && g->skip[at]) {
                *hidden += weight;
                continue;
            }
            if (row_push(r, (uint32_t)at, weight, sense * c->mx * j, sense * c->my * j)) return -1;
            *total += weight;
        }
    }
    return 0;
}

/* A picture of part of the longitudes: a texel across the gap between its ends reaches into both. */
static int add_next_period(bench *b, const double *xy, int n, double period)
{
    if (n > b->copy_room) {
        double *q = realloc(b->copy, sizeof(double) * 2 * (size_t)n);
        if (!q) return -1;
        b->copy = q, b->copy_room = n;
    }
    for (int k = 0; k < n; k++) b->copy[2 * k] = xy[2 * k] + period, b->copy[2 * k + 1] = xy[2 * k + 1];
    overlap_contour(b->cells, b->copy, n);
    return 0;
}

/* The pixel that a texel's centre lies in, as its only one. */
static int texel_centre(row *r, const geometry *g, int x, int y)
{
    double d[3], p[2];
    chart_unproject(d, g->dst, x + 0.5, y + 0.5);
    chart_project(p, g->src, d);
    int px = clamp_int(p[0], 0, g->src->width - 1), py = clamp_int(p[1], 0, g->src->height - 1);
    const size_t at = (size_t)py * (size_t)g->src->width + (size_t)px;
    return g->skip && g->skip[at] ? 0 : row_push(r, (uint32_t)at, 1, 0, 0);
}

static int texel(row *r, bench *b, const geometry *g, int x, int y)
{
    const chart *s = g->src;
    const double *xy;
    int n, sense = outliner_sense(b->lines), rc = outliner_texel(&xy, &n, b->lines, x);
    size_t first = r->n;
    double total = 0, hidden = 0;
    r->alpha[x] = 0;
    if (rc <= 0) return rc;
    double box[4];
    bounds(box, xy, n);
    /* inside out: the texel around the far pole */
    double a = sense * twice_area(xy, n) / 2;
    int around = s->kind == CHART_DISC && b->rim && a < -0.25 * M_PI * chart_disc_scale(s);
    /* what an outline that runs along the rim and back encloses is rounding; but a texel can itself be a
     * speck of a pixel */
    double extent = box[2] - box[0] + box[3] - box[1], least = 1e-9;
    if (fabs(a) < 1 && fabs(a) > 1e-9 * extent * extent) least = 1e-9 * fabs(a);
    if (around) bounds(box, b->rim, b->nrim);
    int wraps = s->kind == CHART_GRID && s->lon_span > 2 * M_PI * (1 - 1e-12);
    int x0 = wraps ? (int)floor(box[0]) : clamp_int(floor(box[0]), 0, s->width);
    int x1 = wraps ? (int)ceil(box[2]) : clamp_int(ceil(box[2]), 0, s->width);
    double next = 0;
    if (s->kind == CHART_GRID && !wraps) {
        double period = 2 * M_PI * s->width / s->lon_span;
        next = box[0] < 0 ? period : box[2] > s->width ? -period : 0;
        if (box[0] + next >= s->width || box[2] + next <= 0) next = 0;
        if (next != 0) x0 = 0, x1 = s->width;
    }
    int y0 = clamp_int(floor(box[1]), 0, s->height), y1 = clamp_int(ceil(box[3]), 0, s->height);
    if (x1 > x0 && y1 > y0) {
        if (overlap_begin(b->cells, x0, y0, x1, y1)) return -1;
        overlap_contour(b->cells, xy, n);
        if (around) overlap_contour(b->cells, b->rim, b->nrim);
        if (next != 0 && add_next_period(b, xy, n, next)) return -1;
        if (collect(&total, &hidden, r, b, g, x0, y0, x1, y1, sense, least)) return -1;
    }
    double full = chart_pixel_solid_angle(g->dst, x, y), share = full > 0 ? total / full : 0;
    /* within the field what is missing is what chords cut off: the texel is what was measured */
    const double measured = total + hidden, chords = OUTLINE_FLATNESS * extent / fmax(fabs(a), 1e-30);
    if (g->whole || (outliner_inside(b->lines, x) && 1 - measured / full < chords))
        share = measured > 0 ? total / measured : 0;
    /* an outline through a pole of the source may come out crossed where the texel is a speck there */
    if (g->whole && full > 0 && full < 16 * (double)g->per_area[s->height / 2] && !(total > 0) &&
        hidden == 0) {
        r->n = first;
        if (texel_centre(r, g, x, y)) return -1;
        total = share = r->n > first;
    }
    if (!(total > 0)) return 0;
    const double per = 1 / total;
    for (size_t i = first; i < r->n; i++) {
        entry *e = r->e + i;
        e->w = (float)(e->w * per), e->wx = (float)(e->wx * per), e->wy = (float)(e->wy * per);
    }
    r->alpha[x] = (float)(share > 0.998 ? 1 : share);
    return 0;
}

int row_init(row *r, int width)
{
    memset(r, 0, sizeof *r);
    r->end = malloc(sizeof *r->end * (size_t)width);
    r->alpha = malloc(sizeof *r->alpha * (size_t)width);
    return r->end && r->alpha ? 0 : -1;
}

void row_free(row *r)
{
    free(r->e);
    free(r->end);
    free(r->alpha);
}

int row_make(row *r, bench *b, const geometry *g, int y)
{
    r->n = 0;
    if (outliner_row(b->lines, y)) return -1;
    for (int x = 0; x < g->dst->width; x++) {
        if (texel(r, b, g, x, y)) return -1;
        r->end[x] = r->n;
    }
    return 0;
}

void geometry_free(geometry *g)
{
    free(g->per_area);
}
