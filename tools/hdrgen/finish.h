/*
 * finish.h - what is done to a merged picture as a whole.  Pure.
 */
#ifndef HDRGEN_FINISH_H
#define HDRGEN_FINISH_H

#include <stdint.h>

#include "base/errmsg.h"

/* Replace marked pixels by the mean of their unmarked neighbours among the 8 (growing the
 * neighbourhood up to 3 pixels).  step: 1, or 2 for a mosaic (neighbours of the same colour). */
void heal_pixels(float *pix, int channels, int width, int height, const uint8_t *marked, int step);

/* Divide by a flat field that is scaled to mean 1 per channel; values not above 1 % of the
 * mean are refused. */
int apply_flat(float *pix, float *sigma, float *flat, int channels, int64_t pixels, const char *path,
               errmsg *e);

/* Luminance of the rectangle's mean, cd/m2 = 179 times the weighted sum of the channels (0.265, 0.670, 0.065
 * for R, G, B of BT.709); one channel: 179 times it. */
double patch_luminance(const float *pix, int channels, int width, int x, int y, int w, int h,
                       const double weight[3]);

#endif
