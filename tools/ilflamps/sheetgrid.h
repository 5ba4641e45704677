/*
 * sheetgrid.h - a sheet above the plane that may hide a lamp: its grid, what the probes' pictures show on it,
 * and a mask that follows both the pictures' edges and the lamp's rows.
 */
#ifndef SHEETGRID_H
#define SHEETGRID_H

#include "model.h"

typedef struct sheetgrid {
    double plane[3]; /* z = plane . (1, x, y) */
    double x0, y0, cell;
    int nx, ny;
} sheetgrid;

/* The part of a sheet that lines from the lamp to the plane, and to what stands up to `above` sizes beyond
 * its edges, cross. */
void sheetgrid_make(sheetgrid *g, const double plane[3], const double lamp[3], const lightfield *f,
                    double above, int cells);

/* Mean log luminance that probes see behind each cell, sums by fold: sum and count have (FOLDS)*nx*ny. */
typedef struct backview {
    double *sum;
    int *count;
} backview;
int backview_make(backview *b, const sheetgrid *g, const lightfield *f);
void backview_free(backview *b);

/* Mean over the probes that are not of `fold`; out: nx*ny. */
void backview_mean(double *out, const backview *b, const sheetgrid *g, int fold);

/* Rows as equations on a sheet's cells. */
typedef struct cellrow {
    int probe, n; /* terms */
    int at[4 * ROW_SAMPLES];
    double w[4 * ROW_SAMPLES];
    double rest; /* light that doesn't cross the sheet */
    double value, share;
} cellrow;

/* base: masks taken for true; rows of all probes.  Returns their number; out: l->nrows. */
int cellrows_make(cellrow *out, const sheetgrid *g, const lamp *l, const lightfield *f, const ilf_mask *base,
                  int nbase);

/* The mask M (nx*ny) that fits the rows of probes not in `fold` and changes where the picture B does:
 *     stiff sum w (M_a - M_b)^2 + sum share (row(M) - value)^2 -> least,  w = exp(-(B_a - B_b)^2/s^2)
 * (a random walker with the rows as data).  M: start and result.  Returns 0, or -1 without memory. */
int walker(double *M, const double *B, const sheetgrid *g, const cellrow *rows, int nrows,
           const lightfield *f, int fold, double stiff);

double cellrow_value(const cellrow *r, const double *M);

#endif
