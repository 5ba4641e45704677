/*
 * spherefind.h - mirror spheres in a photograph: refined from given corners, or found.  Pure.
 */
#ifndef SPHEREFIND_H
#define SPHEREFIND_H

#include "circle.h"
#include "sphere.h"

/* How well the spheres were found. */
typedef struct sphere_fit {
    int seen;     /* spheres whose own rim agrees with the grid within a pixel */
    double rms;   /* of their own rims about the grid, pixels */
    double votes; /* of all rays for the rims, log units: 0 is chance */
} sphere_fit;

/* q: n*m spheres, i fastest, out.  g: from the corners, in; out: fitted to all rims at once, no corner and no
 * radius further than about `reach` pixels from where it was given.  1 (q not set, g as it was): the rims do
 * not stand out from what is around them; -1: no grid fits the corners, or there is no memory.  Grids with a
 * single row or column are for the caller to leave as given. */
int sphere_refine(sphere_seen *q, sphere_fit *fit, sphere_grid *g, const sphere_seen corner[4], double rotate,
                  double reach, const float *pix, int w, int h, errmsg *e);

/* Found corners can be a whole row or column off, where the edge of a table repeats itself as spheres do: of
 * the window and its eight neighbours take the one whose rims show best.  n, m > 1.  -1: no memory. */
int sphere_shift_window(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate,
                        errmsg *e);

/* Corner spheres of an n x m array that fills a good part of the picture; rotate as in sphere_grid_init. */
int sphere_find_corners(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate,
                        errmsg *e);

/* Is a grid that was found, not given, the array?  -1: a sphere is cut by the frame, a larger circle has the
 * better rims, or there are further spheres beside it; the words say which. */
int sphere_check(const sphere_grid *g, const float *pix, int w, int h, errmsg *e);

#endif
