/*
 * filter.h - what a texel's mean weighs: its own area alone, or a Gaussian about its centre.
 *
 * The Gaussian is round in texels of the output, so that in directions it is the ellipse that the output's
 * Jacobian makes of that (elliptical weighted average, Heckbert 1989); and its weights are solid angle, as
 * those of the area are.  It is summed over texels a few times finer, each an exact mean over its own area
 * (remap.h); what these are wide is taken off the Gaussian's variance.
 *
 * Sharp edges become smooth at the price of detail.  A constant stays one, so that in a grid a lamp away from
 * the poles gets exp(s^2/2) of its energy, s the standard deviation in radians of polar angle: 1.00001 for
 * half of 400 rows' texels.
 */
#ifndef FILTER_H
#define FILTER_H

#include "base/errmsg.h"
#include "chart.h"

#define FILTER_LEAST 0.25 /* standard deviations, in texels of the output */
#define FILTER_MOST  8.0

/* Means over the area of each texel of a chart: rgb (3 floats a texel) and alpha, the share of it that is
 * seen. */
typedef int filter_areas(float *rgb, float *alpha, const chart *c, void *arg, errmsg *e);

/* rgb and alpha of the chart `out`.  sd 0: what areas() gives; else the Gaussian of that many texels, for
 * which areas() is called with a chart whose texels are finer.  A texel's Gaussian ends where the chart does,
 * but at the seam of a whole turn and over the poles it goes on.  alpha: share of the weight that is seen;
 * colours are means of what is.  -1: areas() failed, the finer chart would be more than a picture may be, or
 * no memory. */
int filter_texels(float *rgb, float *alpha, const chart *out, double sd, filter_areas *areas, void *arg,
                  errmsg *e);

#endif
