/*
 * times.h - the exposure of each image: seconds, and what ISO and f-number do to it.
 */
#ifndef HDRGEN_TIMES_H
#define HDRGEN_TIMES_H

#include "errmsg.h"

typedef struct shot {
    const char *path;
    double seconds;       /* 0: unknown */
    double f_number, iso; /* 0: unknown */
    double exposure;      /* seconds * gain relative to the first shot; set by shots_resolve */
} shot;

/* Read lines "image seconds [anything]": the image is matched by its whole path, else by its
 * last component.  Every shot must be named exactly once; seconds may be a fraction. */
int times_load(shot *shots, int n, const char *path, errmsg *e);

/* Check that all seconds are known, finite and positive, and set the exposures: seconds *
 * (iso / iso_0) * (f_0 / f)^2 where every shot states them.  *varies: ISO or f-number differ. */
int shots_resolve(shot *shots, int n, int *varies, errmsg *e);

#endif
