/*
 * result.h - the picture that was made, as a file.
 */
#ifndef RESULT_H
#define RESULT_H

#include "base/errmsg.h"
#include "chart.h"
#include "settings.h"

/* Fill texels with alpha 0 as the mode says; rgb w*h*3.  Hold: the nearest covered texel of the
 * column, upwards first. */
void outside_fill(float *rgb, float *alpha, int w, int h, outside_mode mode);

/* Write the picture, of chart c; partial: some alpha is below 1.  view: Radiance's VIEW for a .hdr, or NULL. */
int result_write(const settings *s, const float *rgb, const float *alpha, int partial, const char *view,
                 const chart *c, errmsg *e);

#endif
