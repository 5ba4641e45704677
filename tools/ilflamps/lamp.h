/*
 * lamp.h - a lamp as it is worked on: its body, what each probe measured of it, and the texels that it
 * covered.
 *
 * A row is one measurement: a probe's light from a part of the lamp (a quarter; of wide lamps a sixteenth)
 * over what that part would give unhidden.  Its samples are points of the lamp within that part, as the probe
 * sees it.
 */
#ifndef LAMP_H
#define LAMP_H

#include <math.h>

#include "shape.h"

enum { ROW_SAMPLES = 24, FOLDS = 4 };
#define ABOVE_PLANE 4.

typedef struct row {
    int probe, n;
    double value;               /* 1: unhidden */
    double share;               /* part of the lamp's solid angle */
    double dir[ROW_SAMPLES][3]; /* unit, from the probe to the samples */
} row;

typedef struct lamp {
    shape s;
    centre c;
    double width;   /* largest angle of its cone, radians, full */
    double scatter; /* of its light among probes that see all of it, where pictures are blurred; else 0 */
    row *rows;
    int nrows;
    double *seen; /* per probe: share of the lamp's light that arrived; below 0: none expected (under the
                     horizon) */
    /* texels that were filled in, to be put back where the lamp stays in the field */
    size_t *filled; /* (probe*np + y)*nt + x */
    float *was;     /* 4 each: R G B, and the part of the texel that the lamp covers */
    int nfilled;
} lamp;

/* Measure all probes.  Needs s, c. */
int lamp_measure(lamp *l, const lightfield *f, double limit, errmsg *e);

/* Take it out of the field's texels; lamp_put_back undoes it. */
int lamp_take_out(lamp *l, lightfield *f, double limit, errmsg *e);
void lamp_put_back(lamp *l, lightfield *f);
void lamp_free(lamp *l);

/* It was put out (--set K.off): rays pass as if it were not there. */
static inline int lamp_is_out(const ilf_luminaire *l)
{
    return l->rgb[0] == 0 && l->rgb[1] == 0 && l->rgb[2] == 0;
}

/* Heights up to which something may hide it: the lamp's own; of one at infinity, some sizes of the plane. */
static inline double lamp_ceiling(const lamp *l, const lightfield *f)
{
    return fmin(l->s.l.centre[2], ABOVE_PLANE * f->size);
}

/* Unit of beta: 1, and of a lamp at infinity what stands for a height of one size of the plane. */
static inline double lamp_beta(const lamp *l, const lightfield *f)
{
    return l->c.far ? f->size / l->s.l.centre[2] : 1;
}

/* Probes are left out in four turns, so that each one's neighbours stay in. */
static inline int fold_of(const lightfield *f, int probe)
{
    return (probe % f->nu + 2 * (probe / f->nu)) % FOLDS;
}

#endif
