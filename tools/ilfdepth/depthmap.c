/*
 * depthmap.c - a map of distances: its cells, and how fine it is.
 */
#include "depthmap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec3.h"

static const double pi = 3.14159265358979323846;
enum { MOST_LEVELS = 128, MOST_WIDTH = 384 };

/* Columns: 2/3 of a picture's, but no more than keep all maps at about 400,000 cells. */
static int columns(const views *s)
{
    const view *v = &s->v[0];
    const double texel = fmax(2 * pi / v->nt, v->polar_max / v->np), cells = 4e5 / fmin(s->n, 64);
    const double most = sqrt(cells * 2 * pi / v->polar_max);

    return (int)fmin(fmin(MOST_WIDTH, most), fmax(96, 2 * pi / (1.5 * texel))) / 8 * 8;
}

void sweep_plan_make(sweep_plan *p, const views *s, double near, int width)
{
    memset(p, 0, sizeof *p);
    p->w = width ? width : columns(s);
    p->h = (int)fmax(8, round(p->w / 2. * s->v[0].polar_max / pi));
    const double step = 2 * pi / p->w / s->size; /* a cell of parallax between the farthest two */
    p->most = 1 / (near > 0 ? near : .3 * s->size);
    p->levels = (int)ceil(p->most / step) + 1;
    if (p->levels < 24) p->levels = 24;
    if (p->levels <= MOST_LEVELS) return;
    p->levels = MOST_LEVELS;
    if (near <= 0) p->most = step * (MOST_LEVELS - 1);
}

int depthmap_make(depthmap *m, int number, const sweep_plan *p, errmsg *e)
{
    const size_t n = (size_t)p->w * (size_t)p->h;

    memset(m, 0, sizeof *m);
    m->view = number, m->w = p->w, m->h = p->h;
    m->near = calloc(n, sizeof *m->near), m->free = calloc(n, sizeof *m->free);
    m->sure = calloc(n, sizeof *m->sure), m->error = calloc(n, sizeof *m->error);
    m->from = calloc(n, 1);
    if (m->near && m->free && m->sure && m->error && m->from) return 0;
    depthmap_free(m);
    return err_set(e, "no memory for maps of distances");
}

void depthmap_free(depthmap *m)
{
    free(m->near), free(m->free), free(m->sure), free(m->error), free(m->from);
    memset(m, 0, sizeof *m);
}

void depthmap_direction(double d[3], const depthmap *m, const views *s, int x, int y)
{
    view_direction(d, &s->v[m->view], m->w, m->h, x + .5, y + .5);
}

/* Continuous place of a direction in a map; 0 beyond its last row. */
static int place(double *x, double *y, const depthmap *m, const views *s, const double d[3])
{
    const view *v = &s->v[m->view];
    double own[3];

    v3_into(own, v->axis, d);
    const double r = hypot(own[0], own[1]);
    *x = ((r > 0 ? atan2(own[1], own[0]) : 0) + pi) / (2 * pi) * m->w;
    *y = atan2(r, own[2]) / v->polar_max * m->h;
    return *y < m->h;
}

int depthmap_cell(const depthmap *m, const views *s, const double d[3])
{
    double x, y;

    if (!place(&x, &y, m, s, d)) return -1;
    return (int)y * m->w + (int)x % m->w;
}

double depthmap_look(const depthmap *m, const float *near, const views *s, const double d[3])
{
    double x, y, r[4], lo = 1e30, hi = 0;

    if (!place(&x, &y, m, s, d)) return -1;
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;
    for (int k = 0; k < 4; k++) {
        int i = (int)fx + (k & 1), j = (int)fy + (k >> 1);
        if (j < 0) j = 0, i += m->w / 2;
        if (j >= m->h) j = m->h - 1;
        r[k] = (double)near[j * m->w + (i + 2 * m->w) % m->w];
        lo = fmin(lo, r[k]), hi = fmax(hi, r[k]);
    }
    if (hi > 1.2 * lo) return (double)near[(int)y * m->w + (int)x % m->w];
    return (1 - b) * ((1 - a) * r[0] + a * r[1]) + b * ((1 - a) * r[2] + a * r[3]);
}
