/*
 * gaps.h - what free pictures did not see (alpha 0: a tripod, an operator), taken from the other pictures.
 *
 * A hole's texel looks at a place of the surroundings; pictures that saw it show it in directions of their own
 * (parallax).  What none of them saw is continued from around the hole.  No lamp is put into a hole, since
 * the surroundings are not as far as lamps are: a lamp that a hole cuts is taken for not seen, and is none
 * of that picture's measurements (patch_make).
 */
#ifndef GAPS_H
#define GAPS_H

#include "ilflamps/surroundings.h"

/* Holes (f->unseen) grow over bright spots, above `limit`, that they cut; all are continued from around them. */
int gaps_close(lightfield *f, double limit, errmsg *e);

/* Fill them from the other pictures.  *part: share of their texels that others saw.  Nothing over `limit` is
 * taken. */
int gaps_fill(double *part, lightfield *f, const surroundings *around, double limit, errmsg *e);

#endif
