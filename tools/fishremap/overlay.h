/*
 * overlay.h - the input with what was found drawn on it, to check by eye.
 */
#ifndef OVERLAY_H
#define OVERLAY_H

#include "image/image.h"
#include "sphere.h"

/* PNG of the picture (darkened, its 99th percentile white) with n circles and centre marks;
 * numbered 0..n-1 in reading order by colour from red to blue: the first circle is red.  pix: 4 floats
 * a pixel. */
int overlay_write(const char *path, const img *im, const sphere_seen *q, int n, errmsg *e);

#endif
