/*
 * shape.h - what a lamp looks like: the body whose pictures fit its spots best.
 */
#ifndef SHAPE_H
#define SHAPE_H

#include "centres.h"
#include "ilf_luminaire.h"
#include "patch.h"

typedef struct shape {
    ilf_luminaire l;       /* without masks; rgb set */
    double radiance;       /* luminance of rgb */
    double misfit;         /* rms of texels' misfit over their rms, over the probes that see all of it */
    int full;              /* probes that see all of it */
    double sigma_radiance; /* relative standard error */
} shape;

/* Fit lamp number `number`.  Returns 0; 1 where it can't be told (too few probes see it whole); -1 without
 * memory. */
int shape_fit(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f, double limit);

#endif
