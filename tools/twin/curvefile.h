/*
 * curvefile.h - curves from text files: falloff and response.
 *
 * A line is "x y" (all channels alike) or "x R G B"; '#' starts a comment; x must rise.  The heading
 * lines of hdrgen's response files are passed over.
 */
#ifndef CURVEFILE_H
#define CURVEFILE_H

#include "develop.h"

/* Brightness falloff: x in degrees from the axis, y > 0 relative to the axis. */
int curve_load_falloff(curve3 *c, const char *path, errmsg *e);
/* Response as hdrgen saves it: x code, y the relative exposure that gives it, strictly rising.  Both are
 * scaled so that the last line is 1, 1 in each channel: every channel clips at its full well. */
int curve_load_response(curve3 *c, const char *path, errmsg *e);
void curve_free(curve3 *c);

#endif
