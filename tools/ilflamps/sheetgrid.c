/*
 * sheetgrid.c - a sheet's grid, and what the probes' pictures show on it.
 */
#include "sheetgrid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

/* Where the line from p (on the plane) to the lamp crosses the sheet. */
static int crossing(double x[2], const double plane[3], const double p[3], const double top[3])
{
    double d[3];

    v_sub(d, top, p);
    const double rise = d[2] - plane[1] * d[0] - plane[2] * d[1];
    const double gap = plane[0] + plane[1] * p[0] + plane[2] * p[1] - p[2];
    if (rise <= 0 || gap <= 0 || gap >= rise) return 0;
    for (int k = 0; k < 2; k++) x[k] = p[k] + gap / rise * d[k];
    return 1;
}

void sheetgrid_make(sheetgrid *g, const double plane[3], const double top[3], const lightfield *f,
                    double above, int cells)
{
    double lo[2] = {1e30, 1e30}, hi[2] = {-1e30, -1e30};
    const double m = above * f->size;

    for (int k = 0; k < 4; k++) {
        const double p[3] = {k & 1 ? f->len_u + m : -m, k & 2 ? f->len_v + m : -m, 0};
        double x[2];
        if (!crossing(x, plane, p, top))
            for (int c = 0; c < 2; c++) x[c] = top[c];
        for (int c = 0; c < 2; c++) lo[c] = fmin(lo[c], x[c]), hi[c] = fmax(hi[c], x[c]);
    }
    memcpy(g->plane, plane, sizeof g->plane);
    g->cell = fmax(fmax(hi[0] - lo[0], hi[1] - lo[1]), 1e-6 * f->size) / (cells - 1);
    g->x0 = lo[0], g->y0 = lo[1];
    g->nx = (int)ceil((hi[0] - lo[0]) / g->cell) + 1, g->ny = (int)ceil((hi[1] - lo[1]) / g->cell) + 1;
    if (g->nx < 4) g->nx = 4;
    if (g->ny < 4) g->ny = 4;
}

/* Pictures of more probes than this add nothing. */
enum { MOST_PICTURES = 100 };

int backview_make(backview *b, const sheetgrid *g, const lightfield *f)
{
    const int cells = g->nx * g->ny, step = (f->n + MOST_PICTURES - 1) / MOST_PICTURES;

    b->sum = calloc((size_t)cells * FOLDS, sizeof *b->sum),
    b->count = calloc((size_t)cells * FOLDS, sizeof *b->count);
    if (!b->sum || !b->count) {
        backview_free(b);
        return -1;
    }
#pragma omp parallel for schedule(dynamic, 1)
    for (int j = 0; j < g->ny; j++)
        for (int i = 0; i < g->nx; i++) {
            const double x = g->x0 + i * g->cell, y = g->y0 + j * g->cell;
            const double z = g->plane[0] + g->plane[1] * x + g->plane[2] * y;
            for (int k = 0; k < f->n; k += step) {
                const double d[3] = {x - f->pos[k][0], y - f->pos[k][1], z - f->pos[k][2]};
                double px, py;
                if (d[2] < .05 * v_len(d)) continue;
                lf_place(&px, &py, f, k, d);
                const int at = fold_of(f, k) * cells + j * g->nx + i;
                b->sum[at] += log(fmax(1e-12, lf_look(f, k, px, py))), b->count[at]++;
            }
        }
    return 0;
}

void backview_free(backview *b)
{
    free(b->sum), free(b->count);
    b->sum = NULL, b->count = NULL;
}

void backview_mean(double *out, const backview *b, const sheetgrid *g, int fold)
{
    const int cells = g->nx * g->ny;

    for (int k = 0; k < cells; k++) {
        double s = 0;
        int n = 0;
        for (int q = 0; q < FOLDS; q++)
            if (q != fold) s += b->sum[q * cells + k], n += b->count[q * cells + k];
        out[k] = n ? s / n : 0;
    }
}

static void add_term(cellrow *r, const sheetgrid *g, const double x[2], double w)
{
    const double s = fmax(0, fmin(g->nx - 1.001, (x[0] - g->x0) / g->cell)),
                 t = fmax(0, fmin(g->ny - 1.001, (x[1] - g->y0) / g->cell));
    const int i = (int)s, j = (int)t;

    for (int k = 0; k < 4; k++) {
        r->at[r->n] = (j + (k >> 1)) * g->nx + i + (k & 1);
        r->w[r->n++] = w * (k & 1 ? s - i : 1 - s + i) * (k & 2 ? t - j : 1 - t + j);
    }
}

int cellrows_make(cellrow *out, const sheetgrid *g, const lamp *l, const lightfield *f, const ilf_mask *base,
                  int nbase)
{
    ilf_luminaire body = l->s.l;

    body.nmasks = nbase, body.masks = (ilf_mask *)base;
    for (int k = 0; k < l->nrows; k++) {
        const row *r = &l->rows[k];
        const double *o = f->pos[r->probe];
        cellrow *c = &out[k];
        memset(c, 0, sizeof *c);
        c->probe = r->probe, c->value = r->value, c->share = r->share;
        for (int q = 0; q < r->n; q++) {
            double end[3], x[2];
            const double w = ilf_luminaire_pass(&body, o, r->dir[q]) / r->n,
                         far = (l->s.l.centre[2] - o[2]) / r->dir[q][2];
            for (int a = 0; a < 3; a++) end[a] = o[a] + far * r->dir[q][a];
            if (crossing(x, g->plane, o, end)) add_term(c, g, x, w);
            else c->rest += w;
        }
    }
    return l->nrows;
}

double cellrow_value(const cellrow *r, const double *M)
{
    double v = r->rest;

    for (int k = 0; k < r->n; k++) v += r->w[k] * M[r->at[k]];
    return v;
}
