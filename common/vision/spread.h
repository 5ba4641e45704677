/*
 * spread.h - light that is spread by a Gaussian, and bright spots told apart (OpenCV).  Pure.
 */
#ifndef VISION_SPREAD_H
#define VISION_SPREAD_H

#include "base/errmsg.h"

/* out (w x h, the caller's; not g): g convolved with the Gaussian of standard deviation sd >= 1 pixels and
 * integral 1 over the plane; no light comes from outside the picture, and what leaves it is lost.  Wide ones
 * are computed on a smaller copy (to about 1 % of the Gaussian's peak).  -1: words in e. */
int vision_spread(float *out, const float *g, int w, int h, double sd, errmsg *e);

/* label (w x h): 0, or the number from 1 on of the spot that a pixel of `bright` (w x h bytes, not 0: bright)
 * belongs to; spots less than 2 * apart pixels from each other are one, and labels reach `apart` pixels
 * around each.  Returns the number of spots, or -1 with words in e. */
int vision_spots(int *label, const unsigned char *bright, int w, int h, int apart, errmsg *e);

#endif
