/*
 * slope.c - limited slopes, bad pixels and the rim (slope.h).
 */
#include "slope.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef float v4 __attribute__((vector_size(16)));
typedef int i4 __attribute__((vector_size(16)));

/* Mark what can't be used: alpha 0 and black; everything else gets alpha 1. */
static int64_t mark_bad(float *pix, unsigned char *bad, size_t n)
{
    int64_t nbad = 0;
#pragma omp parallel for schedule(static) reduction(+ : nbad) if (n > 65536)
    for (size_t i = 0; i < n; i++) {
        float *p = pix + 4 * i, all = p[0] + p[1] + p[2];
        int is_bad = !(all - all == 0) || !(p[3] >= 0.5f);
        bad[i] = (unsigned char)is_bad;
        nbad += is_bad;
        if (is_bad) memset(p, 0, 3 * sizeof *p);
        p[3] = is_bad ? 0 : 1;
    }
    return nbad;
}

/* One pixel cut by the circle, at (x, y): the value of the nearest one inwards that lies wholly inside. */
static void hold_pixel(float *pix, unsigned char *bad, const chart *c, int x, int y)
{
    int w = c->width, h = c->height;
    double dx = x + 0.5 - c->cx, dy = y + 0.5 - c->cy, r = hypot(dx, dy);
    for (double back = 0.5; back < 3; back += 0.5) {
        double k = (r - back) / r;
        int xs = (int)floor(c->cx + dx * k), ys = (int)floor(c->cy + dy * k);
        if (xs < 0 || ys < 0 || xs >= w || ys >= h) return;
        if (hypot(fabs(xs + 0.5 - c->cx) + 0.5, fabs(ys + 0.5 - c->cy) + 0.5) > c->radius) continue;
        size_t from = (size_t)ys * (size_t)w + (size_t)xs, to = (size_t)y * (size_t)w + (size_t)x;
        memcpy(pix + 4 * to, pix + 4 * from, 4 * sizeof *pix);
        bad[to] = bad[from];
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
            double dx = fabs(x + 0.5 - c->cx);
            if (hypot(dx + 0.5, dy + 0.5) > c->radius && hypot(dx, dy) <= outer) hold_pixel(pix, bad, c, x, y);
        }
    }
}

static inline v4 min4(v4 a, v4 b)
{
    i4 less = a < b;
    return (v4)(((i4)a & less) | ((i4)b & ~less));
}

static inline v4 abs4(v4 a)
{
    return (v4)((i4)a & 0x7fffffff);
}

/* Slope from the differences to the left and to the right, 0 where they differ in sign. */
static inline v4 limited(v4 a, v4 b)
{
    v4 c = 0.5f * (a + b), twice = 2 * min4(abs4(a), abs4(b)), s = min4(abs4(c), twice);
    i4 sign = (i4)c & (int)0x80000000, same = a * b > 0;
    return (v4)(((i4)s | sign) & same);
}

/* Slopes of the pixels [x0, x1) of one row. */
static void slope_row(remap_source *s, const float *pix, const unsigned char *bad, int y, int x0, int x1, int wrap)
{
    int w = s->width, h = s->height;
    size_t row = (size_t)y * (size_t)w;
    const v4 *up = (const v4 *)pix + (y > 0 ? row - (size_t)w : row), *down = (const v4 *)pix + (y + 1 < h ? row + (size_t)w : row);
    const v4 *here = (const v4 *)pix + row;
    for (int x = x0; x < x1; x++) {
        int xl = x > 0 ? x - 1 : wrap ? w - 1 : x, xr = x + 1 < w ? x + 1 : wrap ? 0 : x;
        v4 p = here[x], gx = limited(p - here[xl], here[xr] - p), gy = limited(p - up[x], down[x] - p);
        if (bad) {
            if (here[xl][3] == 0 || here[xr][3] == 0) gx = (v4){0, 0, 0, 0};
            if (up[x][3] == 0 || down[x][3] == 0) gy = (v4){0, 0, 0, 0};
        }
        /* the lowest corner stays >= 0 */
        v4 dip = 0.5f * (abs4(gx) + abs4(gy));
        i4 low = dip > p;
        if (low[0] | low[1] | low[2])
            for (int c = 0; c < 3; c++) {
                float k = !low[c] ? 1 : p[c] > 0 ? p[c] / dip[c] : 0;
                gx[c] *= k, gy[c] *= k;
            }
        float *q = s->px + (row + (size_t)x) * SRC_FLOATS;
        q[0] = p[0], q[1] = p[1], q[2] = p[2];
        q[3] = gx[0], q[4] = gx[1], q[5] = gx[2];
        q[6] = gy[0], q[7] = gy[1], q[8] = gy[2];
    }
}

int source_prepare(remap_source *s, float *pix, int width, int height, const chart *src, errmsg *e)
{
    size_t n = (size_t)width * (size_t)height;
    remap_source t = {width, height, malloc((n * SRC_FLOATS + 4) * sizeof(float)), malloc(n), 0};
    if (!t.px || !t.bad) {
        source_free(&t);
        return err_set(e, "out of memory");
    }
    memset(t.px + n * SRC_FLOATS, 0, 4 * sizeof(float));
    t.nbad = mark_bad(pix, t.bad, n);
    int is_disc = src->kind == CHART_DISC;
    if (is_disc) hold_rim(pix, t.bad, src);
    int wrap = !is_disc && src->lon_span > 2 * M_PI * (1 - 1e-12);
#pragma omp parallel for schedule(static) if (n > 65536)
    for (int y = 0; y < height; y++) {
        int x[2] = {0, width};
        if (is_disc) row_extent(x, src, y, src->radius + 2);
        slope_row(&t, pix, t.nbad ? t.bad : NULL, y, x[0], x[1], wrap);
    }
    if (!t.nbad) {
        free(t.bad);
        t.bad = NULL;
    }
    *s = t;
    return 0;
}

void source_free(remap_source *s)
{
    free(s->px);
    free(s->bad);
    memset(s, 0, sizeof *s);
}
