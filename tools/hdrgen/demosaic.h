/*
 * demosaic.h - one value per photosite to three per pixel, for radiance of any range.  Pure.
 */
#ifndef HDRGEN_DEMOSAIC_H
#define HDRGEN_DEMOSAIC_H

#include <stdint.h>

#include "base/errmsg.h"
#include "cfa.h"

/* rgb (width*height*3) from the mosaic (width*height).  rgb_sigma and sigma: standard deviations, both or
 * neither NULL.  Borders are mirrored.  Light is kept: over all places of a lamp each colour's sum is 4
 * (Bayer) times that of its photosites.  Nothing comes out brighter or darker than the nearest photosites of
 * its colour, so that nothing becomes negative beside a lamp. */
int demosaic(float *rgb, float *rgb_sigma, const float *mosaic, const float *sigma, int width, int height,
             const cfa *pattern, errmsg *e);

/* A Bayer mosaic at half size: (width/2)*(height/2) pixels, nothing interpolated, the greens' mean. */
void mosaic_half(float *rgb, float *rgb_sigma, const float *mosaic, const float *sigma, int width, int height,
                 const cfa *pattern);

#endif
