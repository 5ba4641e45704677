/*
 * plot.h - the response curve as a picture.
 */
#ifndef HDRGEN_PLOT_H
#define HDRGEN_PLOT_H

#include "job.h"

/* PNG: code (across, 0..max) against log2 exposure (upwards, one line per stop), the curve of each
 * channel over the sample pixels' points (log2 X t_k, z_k). */
int plot_response(const job *j, const char *path, errmsg *e);

#endif
