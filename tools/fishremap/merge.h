/*
 * merge.h - two remapped pictures of the same directions made one: exposure matched where both show well, then
 * each direction from both by weight.
 */
#ifndef MERGE_H
#define MERGE_H

#include "base/errmsg.h"
#include "chart.h"
#include "outcome.h"

/* How well each of the two charts shows direction d (well, 0 and up); returns the say that d has in matching
 * the exposures, 0 to 1. */
typedef double merge_weigh(double well[2], const chart *const charts[2], const double d[3]);

typedef struct merge_views {
    const chart *chart[2], *dst; /* dst: of all of the following, width*height texels */
    float *rgb[2], *alpha[2];    /* 3 and 1 a texel; the caller's.  alpha: share of the texel that is seen */
    merge_weigh *weigh;
} merge_views;

/* o's second_gain: the second view's factor, the median ratio over the directions that both show well by
 * solid angle, so that what moved or shines at one side alone has no say; second_residual: robust relative
 * deviation that is left; second_overlap: steradians.  Too small an overlap (MERGE_LEAST_OVERLAP) gives factor
 * 1 and residual 0.  second_colour: what the median ratio of each colour is to that factor.  -1: no memory. */
#define MERGE_LEAST_OVERLAP 0.05 /* sr, about 14 degrees across */
int merge_match(outcome *o, const merge_views *p, errmsg *e);

/* Both, the second times gain, into rgb[0] and alpha[0].  apart: what one does not see of a texel is what the
 * other does, as beside a rim that both end at, so that shares add up (to 1 at most); else the larger. */
void merge_blend(const merge_views *p, double gain, int apart);

#endif
