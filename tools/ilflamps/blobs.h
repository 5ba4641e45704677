/*
 * blobs.h - the bright spots of each probe.
 */
#ifndef BLOBS_H
#define BLOBS_H

#include "lightfield.h"

typedef struct blob {
    int probe;
    int lamp; /* that it belongs to; -1: none yet, -2: of no lamp */
    int texels;
    double dir[3];    /* of its middle, unit */
    double flux;      /* luminance times solid angle over what surrounds it */
    double spread[6]; /* second moment about the middle, xx xy xz yy yz zz, the texels' own taken off;
                         radian^2 */
    double reach;     /* largest angle of a texel from the middle */
} blob;

typedef struct bloblist {
    blob *b;
    int n, room;
} bloblist;

/* Spots of more than `over` times the probe's median luminance, joined over the seam and the pole, by probe.
 * list is the caller's, to be freed by free(list->b). */
int blobs_find(bloblist *list, const lightfield *f, double over, errmsg *e);

/* Median luminance of a probe. */
double blobs_median(const lightfield *f, int probe);

/* Its mean over all probes: what is many times brighter is no wall. */
double blobs_typical(const lightfield *f);

#endif
