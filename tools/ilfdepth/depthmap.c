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

/* Columns: 2/3 of a picture's, but no more than keep all maps at about two million cells. */
static int columns(const views *s)
{
    const view *v = &s->v[0];
    const double texel = fmax(2 * pi / v->nt, v->polar_max / v->np), cells = 6e5 / fmin(s->n, 64);
    const double most = sqrt(cells * 2 * pi / v->polar_max);

    return (int)fmax(48, fmin(fmin(MOST_WIDTH, most), 2 * pi / (1.5 * texel))) / 8 * 8;
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

int depthmap_cell(const depthmap *m, const views *s, const double d[3])
{
    const view *v = &s->v[m->view];
    double own[3];

    v3_into(own, v->axis, d);
    const double r = hypot(own[0], own[1]), polar = atan2(r, own[2]);
    int x = (int)floor(((r > 0 ? atan2(own[1], own[0]) : 0) + pi) / (2 * pi) * m->w);
    const int y = (int)floor(polar / v->polar_max * m->h);
    if (y >= m->h) return -1;
    if (x >= m->w) x = m->w - 1;
    return y * m->w + x;
}
