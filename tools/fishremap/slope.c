/*
 * slope.c - limited slopes, bad pixels and the rim (slope.h).
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
    double dy = fmax(fabs(y + 0.5 - c->cy) - 0.5, 0), half = dy < radius ? sqrt(radius * radius - dy * dy) : -1;
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
            if (reaches_beyond(dx, dy, c->radius) && dx * dx + dy * dy <= outer * outer) hold_pixel(pix, bad, c, x, y);
        }
    }
}

/* Slopes of the pixels [x0, x1) of one row. */
static void slope_row(remap_source *s, int y, int x0, int x1, int wrap)
{
    int w = s->width, h = s->height;
    size_t row = (size_t)y * (size_t)w;
    const v4 *up = (const v4 *)s->pix + (y > 0 ? row - (size_t)w : row), *down = (const v4 *)s->pix + (y + 1 < h ? row + (size_t)w : row);
    const v4 *here = (const v4 *)s->pix + row;
    for (int x = x0; x < x1; x++) {
        int xl = x > 0 ? x - 1 : wrap ? w - 1 : x, xr = x + 1 < w ? x + 1 : wrap ? 0 : x;
        v4 p = here[x], gx, gy, left = here[xl], right = here[xr], above = up[x], below = down[x];
        if (left[3] == 0 || right[3] == 0) left = right = p;
        if (above[3] == 0 || below[3] == 0) above = below = p;
        slope_pixel(&gx, &gy, p, left, right, above, below);
        float *q = s->slopes + (row + (size_t)x) * SRC_FLOATS;
        q[0] = p[0], q[1] = p[1], q[2] = p[2];
        q[3] = gx[0], q[4] = gx[1], q[5] = gx[2];
        q[6] = gy[0], q[7] = gy[1], q[8] = gy[2];
    }
}

int source_clean(remap_source *s, float *pix, int width, int height, int all_good, const chart *src, errmsg *e)
{
    size_t n = (size_t)width * (size_t)height;
    remap_source t = {width, height, pix, NULL, all_good ? NULL : malloc(n), 0};
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

int source_slopes(remap_source *s, const chart *src, errmsg *e)
{
    size_t n = (size_t)s->width * (size_t)s->height;
    int is_disc = src->kind == CHART_DISC, wrap = !is_disc && src->lon_span > 2 * M_PI * (1 - 1e-12);
    s->slopes = malloc((n * SRC_FLOATS + 4) * sizeof(float));
    if (!s->slopes) return err_set(e, "out of memory");
    memset(s->slopes + n * SRC_FLOATS, 0, 4 * sizeof(float));
#pragma omp parallel for schedule(static) if (n > 65536)
    for (int y = 0; y < s->height; y++) {
        int x[2] = {0, s->width};
        if (is_disc) row_extent(x, src, y, src->radius + 2);
        slope_row(s, y, x[0], x[1], wrap);
    }
    return 0;
}

void source_free(remap_source *s)
{
    free(s->slopes);
    free(s->bad);
    memset(s, 0, sizeof *s);
}
