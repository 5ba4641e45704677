/*
 * times.h - the exposure of each image: seconds, and what ISO and f-number do to it.
 */
#ifndef HDRGEN_TIMES_H
#define HDRGEN_TIMES_H

#include "base/errmsg.h"

typedef struct shot {
    const char *path;
    double seconds;       /* 0: unknown */
    double f_number, iso; /* 0: unknown */
    double exposure;      /* seconds at the first shot's ISO and f-number; set by the two below */
} shot;

/* Read lines "image seconds [anything]": the image is matched by its whole path, else by its
 * last component.  Every shot must be named exactly once; seconds may be a fraction. */
int times_load(shot *shots, int n, const char *path, errmsg *e);

typedef struct times_facts {
    int varies; /* ISO or f-number differ, and count */
    const char *lacks_iso,
        *lacks_f; /* path of the first shot that does not state it while others do; or NULL */
    double iso_assumed, f_assumed; /* what the others agree on, and was taken; 0: nothing was */
    int alone; /* --times stands alone: ISO, f-number are not stated by all, and don't count */
} times_facts;

/* Check that all seconds are known, finite and positive, and set the exposures: seconds * iso / f^2 (not
 * stated: 1), to be made relative by shots_relate when they are in order.  Where some shots don't state
 * ISO or f-number: if all others agree it is theirs; if they differ that is refused, or, where the times
 * are given by hand, neither counts. */
int shots_resolve(shot *shots, int n, int times_given, times_facts *facts, errmsg *e);

/* Exposures as seconds at the first shot's ISO and f-number; shots in order from the shortest, so that the
 * order of the command line does not matter. */
void shots_relate(shot *shots, int n);

#endif
