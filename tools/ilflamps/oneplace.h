/*
 * oneplace.h - lamps of a light field of one probe.
 *
 * One place can't tell how far away a lamp is: it stands where its direction meets the surroundings, and lies on them.
 */
#ifndef ONEPLACE_H
#define ONEPLACE_H

#include "analysis.h"

/* Lamps of the field's only probe into a->lamps (room for p->most), taken out of it, the brightest spots first: those that
 * look like a disc or a rectangle on the surroundings, p->octree; first whole spots, then the bright cores of what was left.
 * What looks otherwise stays in the field.  Sets a->spots and a->stray.  What can't be known is remarked on (remark.h):
 * distances, and whether the picture is clipped. */
int oneplace_lamps(analysis *a, const plan *p, errmsg *e);

#endif
