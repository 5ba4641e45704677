/*
 * walker.c - a mask that follows the pictures' edges and the lamp's rows: a random walker (Grady 2006) whose
 * data are the rows, solved by conjugate gradients with a diagonal preconditioner.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sheetgrid.h"

#define FLOOR     4e-3 /* least weight between cells */
#define CLEAR     3e-4 /* pull towards letting light through, where nothing else is known */
#define EDGE_PART .85  /* quantile of the picture's steps that counts as an edge's beginning */

typedef struct system {
    const sheetgrid *g;
    const cellrow *rows;
    int nrows, fold;
    const lightfield *f;
    double *right, *up, *diagonal, stiff;
} system_t;

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Weights between neighbours to the right and above. */
static int weights(system_t *s, const double *B)
{
    const int nx = s->g->nx, ny = s->g->ny, cells = nx * ny;
    double *v = malloc(2 * (size_t)cells * sizeof *v);
    int n = 0;

    if (!v) return -1;
    for (int k = 0; k < cells; k++) {
        s->right[k] = k % nx + 1 < nx ? fabs(B[k + 1] - B[k]) : -1;
        s->up[k] = k / nx + 1 < ny ? fabs(B[k + nx] - B[k]) : -1;
        if (s->right[k] >= 0) v[n++] = s->right[k];
        if (s->up[k] >= 0) v[n++] = s->up[k];
    }
    qsort(v, (size_t)n, sizeof *v, by_value);
    const double scale = fmax(v[(int)(EDGE_PART * n)], 1e-4);
    free(v);
    for (int k = 0; k < cells; k++) {
        s->right[k] = s->right[k] < 0 ? 0 : s->stiff * (exp(-pow(s->right[k] / scale, 2)) + FLOOR);
        s->up[k] = s->up[k] < 0 ? 0 : s->stiff * (exp(-pow(s->up[k] / scale, 2)) + FLOOR);
    }
    return 0;
}

static void apply(double *y, const double *x, const system_t *s)
{
    const int nx = s->g->nx, cells = nx * s->g->ny;

    for (int k = 0; k < cells; k++) y[k] = CLEAR * x[k];
    for (int k = 0; k < cells; k++) {
        if (s->right[k] > 0) {
            const double d = s->right[k] * (x[k] - x[k + 1]);
            y[k] += d, y[k + 1] -= d;
        }
        if (s->up[k] > 0) {
            const double d = s->up[k] * (x[k] - x[k + nx]);
            y[k] += d, y[k + nx] -= d;
        }
    }
    for (int r = 0; r < s->nrows; r++) {
        const cellrow *c = &s->rows[r];
        double v = 0;
        if (fold_of(s->f, c->probe) == s->fold) continue;
        for (int k = 0; k < c->n; k++) v += c->w[k] * x[c->at[k]];
        v *= c->share;
        for (int k = 0; k < c->n; k++) y[c->at[k]] += v * c->w[k];
    }
}

static void right_side(double *b, const system_t *s)
{
    const int nx = s->g->nx, cells = nx * s->g->ny;

    for (int k = 0; k < cells; k++) b[k] = CLEAR, s->diagonal[k] = CLEAR;
    for (int k = 0; k < cells; k++) {
        s->diagonal[k] += s->right[k] + s->up[k];
        if (s->right[k] > 0) s->diagonal[k + 1] += s->right[k];
        if (s->up[k] > 0) s->diagonal[k + nx] += s->up[k];
    }
    for (int r = 0; r < s->nrows; r++) {
        const cellrow *c = &s->rows[r];
        if (fold_of(s->f, c->probe) == s->fold) continue;
        for (int k = 0; k < c->n; k++) {
            b[c->at[k]] += c->share * (c->value - c->rest) * c->w[k];
            s->diagonal[c->at[k]] += c->share * c->w[k] * c->w[k];
        }
    }
}

static double inner(const double *a, const double *b, int n)
{
    double sum = 0;

    for (int k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

static void conjugate_gradients(double *x, const system_t *s, double *work, int n)
{
    double *r = work, *z = work + n, *p = work + 2 * n, *q = work + 3 * n;

    right_side(r, s);
    const double goal = 1e-8 * inner(r, r, n);
    apply(q, x, s);
    for (int k = 0; k < n; k++) r[k] -= q[k], z[k] = r[k] / s->diagonal[k], p[k] = z[k];
    double rz = inner(r, z, n);
    for (int round = 0; round < 250 && inner(r, r, n) > goal; round++) {
        apply(q, p, s);
        const double a = rz / inner(p, q, n), before = rz;
        for (int k = 0; k < n; k++) x[k] += a * p[k], r[k] -= a * q[k], z[k] = r[k] / s->diagonal[k];
        rz = inner(r, z, n);
        for (int k = 0; k < n; k++) p[k] = z[k] + rz / before * p[k];
    }
}

int walker(double *M, const double *B, const sheetgrid *g, const cellrow *rows, int nrows,
           const lightfield *f, int fold, double stiff)
{
    const int cells = g->nx * g->ny;
    double *work = malloc((size_t)cells * 7 * sizeof *work);
    system_t s = {g, rows, nrows, fold, f, work, work + cells, work + 2 * cells, stiff};

    if (!work || weights(&s, B)) {
        free(work);
        return -1;
    }
    conjugate_gradients(M, &s, work + 3 * cells, cells);
    for (int k = 0; k < cells; k++) M[k] = fmax(0, fmin(1, M[k]));
    free(work);
    return 0;
}
