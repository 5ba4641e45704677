/*
 * raysfile.h - radiance along rays of a file, by the field as it was and by lamps and residual.
 */
#ifndef RAYSFILE_H
#define RAYSFILE_H

#include "analysis.h"

/* rays: doubles ox oy oz dx dy dz hx hy hz (the scene's coordinates, h: where it meets the auxiliary
 * geometry).  radiance: floats R G B of all rays by the input file, then again by lamps and residual. */
int rays_evaluate(const char *radiance, const char *rays, const char *input, const analysis *a, errmsg *e);

/* A ray's radiance: residual's replaced where it meets a lamp.  Coordinates of the field. */
void rays_add_lamps(float rgb[3], const analysis *a, const double o[3], const double d[3]);

#endif
