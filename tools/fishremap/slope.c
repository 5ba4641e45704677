/*
 * slope.c - bad pixels and the rim (slope.h).
 */
#include "slope.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef slope_v4 v4;

/* Mark what can't be used: alpha 0 and black; everything else gets alpha 1. */
static int64_t mark_bad(float *pix, unsigned char *bad, size_t n)
{
    int64_t nbad = 0;
#pragma omp parallel for schedule(static) reduction(+ : nbad) if (n > 65536)
    for (size_t i = 0; i < n; i++) {
        v4 *q = (v4 *)pix + i, rest = *q - *q; /* 0 where finite */
        slope_i4 finite = rest == 0;
        float *p = (float *)q;
        int is_bad = !(finite[0] & finite[1] & finite[2]) | !(p[3] >= 0.5f);
        bad[i] = (unsigned char)is_bad;
        nbad += is_bad;
        if (is_bad) memset(p, 0, 3 * sizeof *p);
        p[3] = is_bad ? 0 : 1;
    }
    return nbad;
}

/* Does a pixel with its centre at (dx, dy) reach beyond the circle? */
static int reaches_beyond(double dx, double dy, double radius)
{
    double x = fabs(dx) + 0.5, y = fabs(dy) + 0.5;
    return x * x + y * y > radius * radius;
}

/* One pixel cut by the circle, at (x, y): the value of the nearest one inwards that lies wholly inside. */
static void hold_pixel(float *pix, unsigned char *bad, const chart *c, int x, int y)
{
    int w = c->width, h = c->height;
    double dx = x + 0.5 - c->cx, dy = y + 0.5 - c->cy, r = sqrt(dx * dx + dy * dy);
    for (double back = 0.5; back < 3; back += 0.5) {
        double k = (r - back) / r;
        int xs = (int)floor(c->cx + dx * k), ys = (int)floor(c->cy + dy * k);
        if (xs < 0 || ys < 0 || xs >= w || ys >= h) return;
        if (reaches_beyond(xs + 0.5 - c->cx, ys + 0.5 - c->cy, c->radius)) continue;
        size_t from = (size_t)ys * (size_t)w + (size_t)xs, to = (size_t)y * (size_t)w + (size_t)x;
        memcpy(pix + 4 * to, pix + 4 * from, 4 * sizeof *pix);
        if (bad) bad[to] = bad[from];
        return;
    }
}

/* A row's first and last pixel (exclusive) that a circle about the disc's centre may touch. */
static void row_extent(int x[2], const chart *c, int y, double radius)
{
    double dy = fmax(fabs(y + 0.5 - c->cy) - 0.5, 0),
           half = dy < radius ? sqrt(radius * radius - dy * dy) : -1;
    double from = floor(c->cx - half), to = ceil(c->cx + half);
    x[0] = half < 0 || from > c->width ? c->width : from < 0 ? 0 : (int)from;
    x[1] = half < 0 || to < 0 ? 0 : to > c->width ? c->width : (int)to;
}

static void hold_rim(float *pix, unsigned char *bad, const chart *c)
{
    double outer = c->radius + M_SQRT1_2, inner = c->radius - 2;
    if (inner < 1) return;
    for (int y = 0; y < c->height; y++) {
        int all[2], core[2] = {c->width, c->width};
        row_extent(all, c, y, outer);
        double dy = fabs(y + 0.5 - c->cy);
        if (dy < inner) { /* pixels that are surely inside */
            double half = sqrt(inner * inner - dy * dy), from = ceil(c->cx - half), to = floor(c->cx + half);
            core[0] = from < 0 ? 0 : from > c->width ? c->width : (int)from;
            core[1] = to < core[0] ? core[0] : to > c->width ? c->width : (int)to;
        }
        for (int x = all[0]; x < all[1]; x++) {
            if (x == core[0] && core[1] > core[0]) x = core[1];
            if (x >= all[1]) break;
            double dx = x + 0.5 - c->cx;
            if (reaches_beyond(dx, dy, c->radius) && dx * dx + dy * dy <= outer * outer)
                hold_pixel(pix, bad, c, x, y);
        }
    }
}

int source_clean(remap_source *s, float *pix, int width, int height, int all_good, const chart *src,
                 errmsg *e)
{
    size_t n = (size_t)width * (size_t)height;
    remap_source t = {width, height, pix, all_good ? NULL : malloc(n), 0};
    if (!all_good && !t.bad) return err_set(e, "out of memory");
    if (!all_good) t.nbad = mark_bad(pix, t.bad, n);
    if (src->kind == CHART_DISC) hold_rim(pix, t.bad, src);
    if (!t.nbad) {
        free(t.bad);
        t.bad = NULL;
    }
    *s = t;
    return 0;
}

void source_free(remap_source *s)
{
    free(s->bad);
    memset(s, 0, sizeof *s);
}
