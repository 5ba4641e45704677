/*
 * steady.h - probes that are turned against each other, as no tripod, stage or photograph of balls puts them
 * down exactly: lamps are beacons that say by how much.
 */
#ifndef STEADY_H
#define STEADY_H

#include "shape.h"

typedef struct steadied {
    int measured; /* probes that see a lamp well enough to be put right */
    double turn;  /* rms angle that they were turned by, radians */
    double sure;  /* of one probe's angle: standard error, radians */
} steadied;

/* By how much probes are turned, from where the bodies s (n of them, number i for spots of lamp i; misfit < 0:
 * none) lie in the pictures of probes that see all of them.  Where that is more than chance, the field's
 * frames of pictures (f->turn) and the spots' directions are put right and 1 is returned; 0: the probes are
 * steady; -1 without memory. */
int steady_put_right(steadied *it, lightfield *f, bloblist *list, const shape *s, int n, double limit);

#endif
