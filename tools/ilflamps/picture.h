/*
 * picture.h - the plane with each lamp's light on it, and a side view.
 */
#ifndef PICTURE_H
#define PICTURE_H

#include "analysis.h"

/* One column a lamp that was taken out.  Above: the plane as seen from above (u to the right, v up) and a
 * quarter of it around; grey: the share of the lamp that arrives as modelled, black to white; squares: as the
 * probes measured it; reddish beyond the plane.  Below: from the side (u to the right, n up): plane, lamp in
 * its colour, the height of what hides it. */
int picture_write(const char *path, const analysis *a, errmsg *e);

#endif
