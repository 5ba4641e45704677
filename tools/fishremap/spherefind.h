/*
 * spherefind.h - mirror spheres in a photograph: refined from given corners, or found.  Pure.
 */
#ifndef SPHEREFIND_H
#define SPHEREFIND_H

#include "circle.h"
#include "sphere.h"

/* How well the spheres were found. */
typedef struct sphere_fit {
    int refined;    /* spheres whose own rim was seen and agrees with the grid */
    double rms;     /* of their centres about the homography, pixels */
} sphere_fit;

/* q: n*m spheres, i fastest, out.  g: from the corners, in; fitted to all rims, out.  Each sphere's rim is sought
 * within a tenth of its radius (at least 3.5 px) of where the grid has it; the homography and
 * a plane of radii are fitted robustly to what was seen.  A sphere gets the grid's place, unless its rim
 * clearly (four standard deviations) stands elsewhere; radii are scaled to where the reflections end.  1 (q not set): fewer than half of the rims are seen;
 * -1: the rims contradict the corners. */
int sphere_refine(sphere_seen *q, sphere_fit *fit, sphere_grid *g, const float *pix, int w, int h, errmsg *e);

/* Corner spheres of an n x m array that fills a good part of the picture; rotate as in sphere_grid_init. */
int sphere_find_corners(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate, errmsg *e);

#endif
