/*
 * falloff_write.h - a measured falloff as a text file (falloff.h reads it) and as a plot like the
 * paper's figure 6.
 */
#ifndef FALLOFF_WRITE_H
#define FALLOFF_WRITE_H

#include "falloff_fit.h"

/* Lines "DEG R G B sdR sdG sdB" each degree up to the rim, the readings as comments. */
int falloff_write(const char *path, const falloff_curve f[3], const falloff_reading *r, int n,
                  const char *command, errmsg *e);

/* SVG: curve per channel with its band of two standard deviations, readings as dots, outliers hollow. */
int falloff_plot(const char *path, const falloff_curve f[3], const falloff_reading *r, int n, errmsg *e);

#endif
