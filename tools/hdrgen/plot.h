/*
 * plot.h - the response curve as a plot.
 */
#ifndef HDRGEN_PLOT_H
#define HDRGEN_PLOT_H

#include "job.h"

/* SVG: code (across, 0..max) against log2 exposure (upwards, in stops below the brightest), the curve of each
 * channel over the sample pixels' points (log2 X t_k, z_k). */
int plot_response(const job *j, const char *path, errmsg *e);

#endif
