/*
 * overlap.c - exact polygon-pixel overlap by edges (overlap.h).
 *
 * The area of a region is the integral over its boundary of -(area to the right of the edge) dy.
 * An edge piece inside one pixel adds its own trapezoid to that pixel, and the whole strip
 * dy to every pixel further right: the latter is kept as a running cover per row.
 *
 *      +-----+-----+-----+        piece from (u0,v0) to (u1,v1) in its pixel, dy = v0 - v1:
 *      |   \#|#####|#####|          own area  dy (1 - (u0+u1)/2)
 *      |    \|#####|#####|          further pixels  dy each
 *      +-----+-----+-----+
 */
#include "overlap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct piece_sum {
    double area, mx, my;   /* this pixel */
    double cover, cover_y; /* to every pixel further right: area, moment */
} piece_sum;

typedef struct extent {
    int first, last; /* pixels of a row that an edge touches; first > last: none */
} extent;

struct overlap {
    int x0, y0, x1, y1;
    piece_sum *cell; /* all 0 between one polygon's rows read and the next one's edges */
    extent *touched; /* by row */
    size_t room, rows;
};

overlap *overlap_new(void)
{
    return calloc(1, sizeof(overlap));
}

void overlap_free(overlap *o)
{
    if (!o) return;
    free(o->cell);
    free(o->touched);
    free(o);
}

int overlap_begin(overlap *o, int x0, int y0, int x1, int y1)
{
    size_t w = x1 > x0 ? (size_t)(x1 - x0) : 0, h = y1 > y0 ? (size_t)(y1 - y0) : 0, n = w * h;
    if (n > o->room) {
        free(o->cell);
        o->room = n + n / 2;
        o->cell = calloc(o->room, sizeof *o->cell);
        if (!o->cell) {
            o->room = 0;
            return -1;
        }
    }
    if (h > o->rows) {
        free(o->touched);
        o->rows = h + h / 2;
        o->touched = malloc(o->rows * sizeof *o->touched);
        if (!o->touched) {
            o->rows = 0;
            return -1;
        }
    }
    o->x0 = x0, o->y0 = y0, o->x1 = x0 + (int)w, o->y1 = y0 + (int)h;
    for (size_t y = 0; y < h; y++) o->touched[y] = (extent){(int)w, -1};
    return 0;
}

/* A piece that lies in pixel (ix, iy) of the box; coordinates relative to that pixel. */
static inline void add_piece(overlap *o, int ix, int iy, double u0, double v0, double u1, double v1)
{
    piece_sum *c = o->cell + (size_t)iy * (size_t)(o->x1 - o->x0) + ix;
    double dy = v0 - v1, u = 0.5 * (u0 + u1), v = 0.5 * (v0 + v1) - 0.5;
    c->area += dy * (1 - u);
    c->mx += dy * 0.5 * (u - (u0 * u0 + u0 * u1 + u1 * u1) * (1. / 3));
    c->my += dy * (v * (1 - u) + dy * (u1 - u0) * (1. / 12));
    c->cover += dy;
    c->cover_y += dy * v;
    extent *t = o->touched + iy;
    if (ix < t->first) t->first = ix;
    if (ix > t->last) t->last = ix;
}

/* An edge part inside row iy, coordinates relative to the box, y relative to the row. */
static void add_across(overlap *o, int iy, double xa, double va, double xb, double vb);

static inline void add_in_row(overlap *o, int iy, double xa, double va, double xb, double vb)
{
    double w = o->x1 - o->x0;
    if (xa >= 0 && xb >= 0 && xa < w && xb < w) { /* most often: one pixel */
        int i = (int)xa;
        if (i == (int)xb) {
            add_piece(o, i, iy, xa - i, va, xb - i, vb);
            return;
        }
    }
    add_across(o, iy, xa, va, xb, vb);
}

static void add_across(overlap *o, int iy, double xa, double va, double xb, double vb)
{
    double w = o->x1 - o->x0;
    if (xa >= w && xb >= w) return;
    if (xa <= 0 && xb <= 0) {
        add_piece(o, 0, iy, 0, va, 0, vb);
        return;
    }
    if (xa < 0 || xb < 0 || xa > w || xb > w) { /* cut at the box's sides */
        double cut = (xa < 0 || xb < 0) ? 0 : w, s = (cut - xa) / (xb - xa), vc = va + s * (vb - va);
        add_across(o, iy, xa, va, cut, vc);
        add_across(o, iy, cut, vc, xb, vb);
        return;
    }
    int i = (int)xa, j = (int)xb, last = (int)w - 1;
    if (i > last) i = last;
    if (j > last) j = last;
    if (i == j) {
        add_piece(o, i, iy, xa - i, va, xb - i, vb);
        return;
    }
    double slope = (vb - va) / (xb - xa), x = xa, v = va;
    int step = i < j ? 1 : -1;
    for (; i != j; i += step) {
        double xe = step > 0 ? i + 1 : i, ve = va + (xe - xa) * slope;
        add_piece(o, i, iy, x - i, v, xe - i, ve);
        x = xe, v = ve;
    }
    add_piece(o, j, iy, x - j, v, xb - j, vb);
}

static void add_edge(overlap *o, double xa, double ya, double xb, double yb)
{
    double h = o->y1 - o->y0;
    if (ya == yb || (ya <= 0 && yb <= 0) || (ya >= h && yb >= h)) return;
    double slope = (xb - xa) / (yb - ya);
    if (ya < 0) xa -= ya * slope, ya = 0;
    if (yb < 0) xb -= yb * slope, yb = 0;
    if (ya > h) xa += (h - ya) * slope, ya = h;
    if (yb > h) xb += (h - yb) * slope, yb = h;
    int last = (int)h - 1, i = (int)ya, j = (int)yb;
    if (i > last) i = last;
    if (j > last) j = last;
    if (i == j) {
        add_in_row(o, i, xa, ya - i, xb, yb - i);
        return;
    }
    double x = xa, y = ya;
    int step = i < j ? 1 : -1;
    for (; i != j; i += step) {
        double ye = step > 0 ? i + 1 : i, xe = xa + (ye - ya) * slope;
        add_in_row(o, i, x, y - i, xe, ye - i);
        x = xe, y = ye;
    }
    add_in_row(o, j, x, y - j, xb, yb - j);
}

void overlap_contour(overlap *o, const double *xy, int n)
{
    if (o->x1 == o->x0 || o->y1 == o->y0 || n < 3) return;
    double xa = xy[2 * n - 2] - o->x0, ya = xy[2 * n - 1] - o->y0;
    for (int i = 0; i < n; i++) {
        double xb = xy[2 * i] - o->x0, yb = xy[2 * i + 1] - o->y0;
        add_edge(o, xa, ya, xb, yb);
        xa = xb, ya = yb;
    }
}

int overlap_row(overlap_cell *out, int *from, overlap *o, int y)
{
    int w = o->x1 - o->x0;
    const extent *t = o->touched + (y - o->y0);
    piece_sum *c = o->cell + (size_t)(y - o->y0) * (size_t)w + t->first;
    double cover = 0, cover_y = 0;
    *from = o->x0 + t->first;
    for (int i = t->first; i <= t->last; i++, c++, out++) {
        out->area = c->area + cover;
        out->mx = c->mx;
        out->my = c->my + cover_y;
        cover += c->cover;
        cover_y += c->cover_y;
        *c = (piece_sum){0};
    }
    if (t->first > t->last || fabs(cover) < 1e-12) return o->x0 + t->last + 1;
    /* the polygon goes on beyond the box */
    for (int i = t->last + 1; i < w; i++) *out++ = (overlap_cell){cover, 0, cover_y};
    return o->x1;
}
