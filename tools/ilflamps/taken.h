/*
 * taken.h - the lamps that were taken out, as a file of version 2 holds them; and back.
 */
#ifndef TAKEN_H
#define TAKEN_H

#include "analysis.h"

/* Lamps that were taken out come first, each kind in its old order: so a lamp's number is the same in the
 * report and in the file. */
void taken_first(analysis *a);

/* The lamps that were taken out; *n of them.  Masks belong to the analysis; free with taken_free.  NULL
 * without memory. */
ilf_luminaire *taken_lamps(int *n, const analysis *a);
void taken_free(ilf_luminaire *lamps, int n);

/* What an analysis would have found, from a light field of version 2 that somebody found it for.  *a is the
 * caller's until analysis_free. */
int taken_read(analysis *a, const char *path, errmsg *e);

#endif
