/*
 * dual.h - two circles in one picture, of lenses that look opposite ways: each remapped by its own calibration,
 * then merged.
 */
#ifndef DUAL_H
#define DUAL_H

#include "base/errmsg.h"
#include "chart.h"
#include "image/image.h"
#include "outcome.h"
#include "remapjob.h"
#include "settings.h"

/* rgb (3 floats a texel) and alpha of dst from the picture im, 4 channels, whose alpha says what counts.  w: what
 * pictures of one geometry share, of each circle.  o gets gain, residual, overlap and remarks. */
int dual_remap(float *rgb, float *alpha, outcome *o, session w[2], const settings *s, const img *im,
               int all_good, const chart *dst, errmsg *e);

#endif
