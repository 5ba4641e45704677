/*
 * smooth.h - hypotheses that know nothing of the pictures: interpolation, smooth masks, beams and gates. Each
 * appends one mask to the five versions of `m` (which holds what is taken for true already) and judges it.
 * They return 0; 1 where they don't apply; -1 without memory.
 */
#ifndef SMOOTH_H
#define SMOOTH_H

#include "model.h"
#include "pictures.h"

/* Shares measured, bilinear between probes (multiplies), or what the masks so far leave of them (adds). */
int smooth_interpolation(model *m, const lamp *l, const lightfield *f, int adds);

/* A smooth mask in foot coordinates (Gaussian process, Matern 5/2): beta and length by left-out probes. */
int smooth_process(model *m, const lamp *l, const lightfield *f, const pictures *pics);

/* cos^k about an axis. */
int smooth_beam(model *m, const lamp *l, const lightfield *f, const pictures *pics);

/* A profile spotlight: logistic of a quadratic in foot coordinates. */
int smooth_gate(model *m, const lamp *l, const lightfield *f, const pictures *pics);

#endif
