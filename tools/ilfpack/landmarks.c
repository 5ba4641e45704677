/*
 * landmarks.c - see landmarks.h.
 */
#include "landmarks.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/vec.h"

static const double pi = 3.14159265358979323846;

enum { POINTS = 1600, ROWS = 64, COLUMNS = 256, SAMPLES = 36 };
#define GRAZING .15    /* cosine to a wall's normal below which its luminance runs too fast across a crease */
#define LOWEST  (-.03) /* z of directions looked at: a floor's edge shows how high cameras stand */

static int make(landmarks *l, int room, const lightfield *f, errmsg *e)
{
    memset(l, 0, sizeof *l);
    l->middle[0] = f->len_u / 2, l->middle[1] = f->len_v / 2;
    l->m = calloc((size_t)room, sizeof *l->m);
    return l->m ? 0 : err_set(e, "no memory for landmarks");
}

void landmarks_free(landmarks *l)
{
    free(l->m);
    memset(l, 0, sizeof *l);
}

/* Directions spread evenly from nearly upright to a little below the horizon. */
static void spread(double d[3], int k)
{
    const double z = .98 + (LOWEST - .98) * (k + .5) / POINTS, r = sqrt(1 - z * z), t = 2.399963229728653 * k;

    d[0] = r * cos(t), d[1] = r * sin(t), d[2] = z;
}

/* ---- an octree ------------------------------------------------------------------------------------ */

/* What a ray met. */
typedef struct meeting {
    double x[3], n[3];
    int met;
} meeting;

static int trace(meeting *m, double (*d)[3], int n, const char *octree, const landmarks *l,
                 const lightfield *f, errmsg *e)
{
    double *rays = malloc((size_t)n * 6 * sizeof *rays), o[3];
    float *got = malloc((size_t)n * 6 * sizeof *got);
    const ilf_frame *fr = &f->frame;
    const double *axis[3] = {fr->u, fr->v, fr->n};
    int bad = rays && got ? 0 : err_set(e, "no memory for rays");

    for (int c = 0; c < 3; c++)
        o[c] = fr->origin[c] + l->middle[0] * fr->u[c] + l->middle[1] * fr->v[c] + 1e-4 * f->size * fr->n[c];
    for (int k = 0; k < n && !bad; k++)
        for (int c = 0; c < 3; c++) {
            rays[6 * k + c] = o[c];
            rays[6 * k + 3 + c] = d[k][0] * fr->u[c] + d[k][1] * fr->v[c] + d[k][2] * fr->n[c];
        }
    if (!bad) bad = surroundings_rtrace(got, 6, "-opN", rays, n, octree, e);
    for (int k = 0; k < n && !bad; k++) {
        double off[3], normal[3];
        for (int c = 0; c < 3; c++)
            off[c] = (double)got[6 * k + c] - fr->origin[c], normal[c] = (double)got[6 * k + 3 + c];
        for (int a = 0; a < 3; a++) m[k].x[a] = v_dot(off, axis[a]), m[k].n[a] = v_dot(normal, axis[a]);
        v_sub(off, m[k].x, l->middle);
        m[k].met = v_dot(normal, normal) > .5 && v_len(off) < 1e4 * f->size;
    }
    free(rays), free(got);
    return bad;
}

/* Where three planes meet: two walls, and that of the two rays. */
static int corner(double x[3], const meeting *a, const meeting *b, const double m[3], const double along[3])
{
    double bm[3], ma[3];
    const double da = v_dot(a->n, a->x), db = v_dot(b->n, b->x);

    const double det = v_dot(m, along);
    if (fabs(det) < 1e-6) return 0;
    v_cross(bm, b->n, m), v_cross(ma, m, a->n);
    for (int c = 0; c < 3; c++) x[c] = (da * bm[c] + db * ma[c]) / det;
    return 1;
}

/* Two rays side by side that met different walls: where between them one wall ends at the other. */
static int crease(landmark *l, const meeting *a, const meeting *b, const double middle[3])
{
    double p[3], q[3], m[3], along[3], e[3], far[3];

    if (!a->met || !b->met) return 0;
    v_cross(along, a->n, b->n);
    if (v_unit(along) < .2) return 0;
    v_sub(p, a->x, middle), v_sub(q, b->x, middle);
    v_cross(m, p, q);
    if (v_unit(m) <= 0) return 0;
    meeting A = *a, B = *b;
    memcpy(A.x, p, sizeof p), memcpy(B.x, q, sizeof q); /* from the middle on */
    double plain[3];
    v_cross(plain, a->n, b->n);
    if (!corner(e, &A, &B, m, plain)) return 0;
    /* it must lie between the rays */
    v_cross(far, p, e);
    const double first = v_dot(far, m);
    v_cross(far, e, q);
    if (first <= 0 || v_dot(far, m) <= 0 || v_dot(e, p) <= 0) return 0;
    memset(l, 0, sizeof *l);
    const double least = GRAZING * v_len(e);
    if (fabs(v_dot(e, a->n)) < least || fabs(v_dot(e, b->n)) < least) return 0;
    for (int c = 0; c < 3; c++) l->x[c] = middle[c] + e[c];
    memcpy(l->along, along, sizeof along);
    return 1;
}

static void look_down(double d[3], int i, int j)
{
    const double p = (j + .5) / ROWS * (pi / 2 - LOWEST * 1.5), t = 2 * pi * i / COLUMNS;

    d[0] = sin(p) * cos(t), d[1] = sin(p) * sin(t), d[2] = cos(p);
}

static void add_creases(landmarks *l, const meeting *m, int room)
{
    for (int k = 0; k < ROWS * COLUMNS && l->n < room - 1; k++) {
        const int i = k % COLUMNS, j = k / COLUMNS;
        l->n += crease(&l->m[l->n], &m[k], &m[j * COLUMNS + (i + 1) % COLUMNS], l->middle);
        if (j + 1 < ROWS) l->n += crease(&l->m[l->n], &m[k], &m[k + COLUMNS], l->middle);
    }
}

int landmarks_trace(landmarks *l, const char *octree, const lightfield *f, errmsg *e)
{
    const int rays = POINTS + ROWS * COLUMNS, room = POINTS + 4096;
    double(*d)[3] = malloc((size_t)rays * sizeof *d);
    meeting *m = malloc((size_t)rays * sizeof *m);
    int bad = make(l, room, f, e);

    if (!bad && (!d || !m)) bad = err_set(e, "no memory for landmarks");
    for (int k = 0; k < rays && !bad; k++)
        if (k < POINTS) spread(d[k], k);
        else look_down(d[k], (k - POINTS) % COLUMNS, (k - POINTS) / COLUMNS);
    if (!bad) bad = trace(m, d, rays, octree, l, f, e);
    for (int k = 0; k < POINTS && !bad; k++)
        if (m[k].met) memcpy(l->m[l->n++].x, m[k].x, sizeof m[k].x);
    const int points = l->n;
    if (!bad) add_creases(l, m + POINTS, room);
    l->creases = l->n - points;
    free(d), free(m);
    if (bad) landmarks_free(l);
    return bad;
}

/* ---- a box ---------------------------------------------------------------------------------------- */

/* Landmark k of a box: POINTS directions, then the edges below the ceiling and the upright ones.  1 if it
 * is one. */
static int of_box(landmark *l, int k, const double b[BOX], const double middle[3], const double was[BOX])
{
    double p[3] = {0, 0, 0}, along[3] = {0, 0, 0};

    if (k < POINTS) {
        double d[3], t = 1e300;
        int face = 4;
        spread(d, k);
        for (int c = 0; c < 3; c++) { /* by the box as it was: landmarks stay on their walls */
            const double wall = c < 2 ? was[2 * c + (d[c] > 0)] - middle[c] : was[4];
            if (c == 2 && d[c] <= 0) continue;
            if (d[c] * wall > 0 && wall / d[c] < t) t = wall / d[c], face = c < 2 ? 2 * c + (d[c] > 0) : 4;
        }
        if (!(t < 1e299)) return 0;
        const int axis = face < 4 ? face / 2 : 2;
        const double wall = face < 4 ? b[face] - middle[axis] : b[4];
        for (int c = 0; c < 3; c++) p[c] = c == axis ? wall : d[c] * t;
    } else {
        const int edge = (k - POINTS) / SAMPLES;
        const double s = ((k - POINTS) % SAMPLES + .5) / SAMPLES;
        if (edge < 4) { /* below the ceiling */
            const int axis = edge / 2, other = 1 - axis;
            p[axis] = b[edge] - middle[axis],
            p[other] = was[2 * other] + s * (was[2 * other + 1] - was[2 * other]) - middle[other];
            p[2] = b[4], along[other] = 1;
        } else {
            p[0] = b[(edge - 4) & 1] - middle[0], p[1] = b[2 + ((edge - 4) >> 1)] - middle[1];
            p[2] = s * was[4], along[2] = 1;
        }
    }
    const double c = cos(b[5]), sn = sin(b[5]);
    l->x[0] = middle[0] + c * p[0] - sn * p[1], l->x[1] = middle[1] + sn * p[0] + c * p[1], l->x[2] = p[2];
    l->along[0] = c * along[0] - sn * along[1], l->along[1] = sn * along[0] + c * along[1],
    l->along[2] = along[2];
    return 1;
}

static void fill_box(landmarks *l)
{
    l->n = l->creases = 0;
    for (int k = 0; k < POINTS + 8 * SAMPLES; k++) {
        landmark *m = &l->m[l->n];
        if (!of_box(m, k, l->box, l->middle, l->box)) continue;
        for (int q = 0; q < BOX; q++) {
            landmark moved;
            double b[BOX];
            const double step = 1e-4 * (q < 5 ? l->box[4] : 1);
            memcpy(b, l->box, sizeof b);
            b[q] += step;
            of_box(&moved, k, b, l->middle, l->box);
            for (int c = 0; c < 3; c++) m->lean[q][c] = (moved.x[c] - m->x[c]) / step;
        }
        l->n++, l->creases += k >= POINTS;
    }
}

int landmarks_box(landmarks *l, const surroundings *s, const lightfield *f, errmsg *e)
{
    if (make(l, POINTS + 8 * SAMPLES, f, e)) return -1;
    l->movable = BOX;
    memcpy(l->box, s->box, 5 * sizeof *l->box);
    fill_box(l);
    return 0;
}

void landmarks_move(landmarks *l, const double d[BOX])
{
    if (!l->movable) return;
    for (int k = 0; k < BOX; k++) l->box[k] += d[k];
    fill_box(l);
}
