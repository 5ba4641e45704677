/*
 * finish.h - what is done to a merged picture as a whole.  Pure.
 */
#ifndef HDRGEN_FINISH_H
#define HDRGEN_FINISH_H

#include <stdint.h>

#include "errmsg.h"

/* One-colour-per-pixel radiance to RGB.  bayer: colours of the 2x2 positions.  mosaic and sigma
 * (may be NULL) are width*height; rgb and rgb_sigma (NULL with sigma) three times that.  Green is interpolated along
 * the weaker gradient, red and blue by their ratio to green, so that nothing becomes negative. */
int bayer_to_rgb(float *rgb, float *rgb_sigma, const float *mosaic, const float *sigma, int width,
                 int height, const int bayer[4], errmsg *e);

/* Replace marked pixels by the mean of their unmarked neighbours among the 8 (growing the
 * neighbourhood up to 3 pixels).  step: 1, or 2 for a mosaic (neighbours of the same colour). */
void heal_pixels(float *pix, int channels, int width, int height, const uint8_t *marked, int step);

/* Divide by a flat field that is scaled to mean 1 per channel; values not above 1 % of the
 * mean are refused. */
int apply_flat(float *pix, float *sigma, float *flat, int channels, int64_t pixels, const char *path, errmsg *e);

/* Luminance of the rectangle's mean, cd/m2 = 179 (0.265 R + 0.670 G + 0.065 B). */
double patch_luminance(const float *pix, int channels, int width, int x, int y, int w, int h);

#endif
