/*
 * exposures.h - which exposure times a session has, and which of them a place needs (pure).
 */
#ifndef EXPOSURES_H
#define EXPOSURES_H

#include "base/errmsg.h"

enum { EXPOSURES_MAX = 64 };

/* "1/60 1/30 ..." (rising) or "from A to B step S", S in stops, ends included.  seconds gets *n <=
 * EXPOSURES_MAX. */
int exposures_parse(double *seconds, int *n, const char *text, errmsg *e);

/* What is known of one exposure of the series at hand. */
typedef struct exposure_seen {
    int taken;
    int clips; /* more pixels at the highest code than the session tolerates */
    int black; /* more pixels at the lowest code than the session tolerates */
} exposure_seen;

/* The exposure to take next, or -1 when the place needs no more.  The series begins at first_guess, goes down
 * until nothing clips, then up until nothing is black: shorter and longer ones would only repeat what is
 * known. */
int exposures_next(const exposure_seen *seen, int n, int first_guess);

/* Where the next place should begin: the longest exposure that did not clip here, else the shortest
 * that was taken, else `otherwise`. */
int exposures_guess(const exposure_seen *seen, int n, int otherwise);

#endif
