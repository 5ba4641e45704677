/*
 * regrid.h - what is left of free pictures once the lamps are out, resampled onto a regular grid.
 *
 * A node's texel looks at a place of the surroundings; the pictures round the node show that place in
 * directions of their own (parallax), and their values are joined by weights that are exact for whatever
 * changes linearly over the plane (local regression), held back where a node has pictures on one side only.
 */
#ifndef REGRID_H
#define REGRID_H

#include "ilflamps/analysis.h"

/* How well a place on the plane is supported. */
typedef struct reach {
    double at[2];   /* field's coordinates */
    double nearest; /* distance of the nearest picture */
    double error;   /* relative standard error of the irradiance from above: what is left and lamps */
} reach;

/* Resample onto nu x nv probes of nt x np texels of the upper hemisphere.  *g is the caller's until lf_free;
 * around must be known. */
int regrid(lightfield *g, const lightfield *f, const surroundings *around, int nu, int nv, int nt, int np,
           errmsg *e);

/* Fill r (nu*nv, i fastest).  The errors come from pictures left out one by one: how far the others' light
 * goes wrong there, by the distance from the nearest of them, and from the lamps' held-out errors. */
int regrid_reach(reach *r, const analysis *a, int nu, int nv, errmsg *e);

/* Weights of the field's pictures at a place, picture `without` left out (-1: none); w has f->n. */
void regrid_weights(double *w, const lightfield *f, double x, double y, int without);

#endif
