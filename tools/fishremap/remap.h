/*
 * remap.h - second-order conservative remap of one picture of directions to another.
 *
 * Each destination texel is the solid-angle weighted mean of the source over its footprint:
 * the texel's outline is carried into the source picture as a polygon, its exact overlap
 * with every source pixel (overlap.h) weighted with the pixel's solid angle per area (Jacobian
 * of the lens).  Inside a source pixel radiance is a plane, L + g.(x - centre), with a
 * limited slope g that does not change the pixel's mean nor, along x or y, leave the range of its neighbours;
 * in a corner it may, but never below 0 (slope.h).  So lamps keep their energy at any size.
 *
 * A plan holds the weights of one geometry and serves any number of pictures.
 */
#ifndef REMAP_H
#define REMAP_H

#include <stddef.h>
#include <stdint.h>

#include "base/errmsg.h"
#include "chart.h"
#include "slope.h"

typedef struct remap_plan remap_plan;

/* Weights that take pictures of chart src (sides below 65536) to chart dst, every source pixel counting. */
int remap_plan_new(remap_plan **plan, const chart *dst, const chart *src, errmsg *e);
void remap_plan_free(remap_plan *p);

/* rgb: dst width*height*3; alpha (may be NULL): share of the texel's solid angle that the source
 * covers, 0..1.  Texels that nothing covers are 0.  s may have no bad pixels. */
int remap_apply(float *rgb, float *alpha, const remap_plan *p, const remap_source *s, errmsg *e);

/* Both at once, row by row, without holding the plan; s may have bad pixels. */
int remap_run(float *rgb, float *alpha, const chart *dst, const chart *src, const remap_source *s, errmsg *e);

/* Number of overlaps (pixel pieces) in the plan. */
int64_t remap_plan_size(const remap_plan *p);

#endif
