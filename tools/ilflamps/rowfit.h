/*
 * rowfit.h - a lamp's rows against one more mask: what forms of few numbers (beams, gates) are fitted to.
 */
#ifndef ROWFIT_H
#define ROWFIT_H

#include "model.h"

typedef struct rowfit {
    const model *m; /* masks taken for true */
    const lamp *l;
    const lightfield *f;
    int fold;     /* whose probes are left out; ALL: none */
    double *base; /* per row and sample: what the masks so far let through */
} rowfit;

/* Of all probes.  0, or -1 without memory; *j is the caller's until rowfit_free. */
int rowfit_make(rowfit *j, const model *m, const lamp *l, const lightfield *f);
void rowfit_free(rowfit *j);

/* Leave another fold's probes out. */
void rowfit_fold(rowfit *j, int fold);

/* r: as many as the lamp has rows; sqrt(share) x (modelled - measured), 0 of those left out. */
void rowfit_residuals(double *r, const ilf_mask *mask, const rowfit *j);

/* Rows see the lamp as points: how soft the edge of what hides it must be, at the lamp, lest each point count all or
 * nothing.  The scale of a logistic, scene's unit: .28 of the mean distance between a probe's points (set by trial). */
double rowfit_softness(const lamp *l, const lightfield *f);

#endif
