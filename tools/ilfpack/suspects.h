/*
 * suspects.h - lines that can't be true: pictures that disagree with all others where their line has them.
 *
 * Two lines may have each other's names; a line may have a wrong sign, its heading counted the other way round
 * or from elsewhere, x and y in each other's place.  What makes the picture agree with the others is what is
 * meant.
 */
#ifndef SUSPECTS_H
#define SUSPECTS_H

#include "landmarks.h"
#include "positions.h"
#include "views.h"

typedef struct suspect {
    int picture, other;   /* picture -1: all; other: with which it was swapped, or -1 */
    double before, after; /* disagreement with the other pictures as given, and as meant */
    char words[240];      /* which line, and what is meant */
} suspect;

typedef struct suspects {
    suspect *s;
    int n;
    double others; /* disagreement of pictures that are not suspected, median */
} suspects;

/* Look for them, and put right (places and field) those that are understood, unless `keep`.  What is wrong and
 * not understood, with a disagreement beyond doubt, is an error that names the line. */
int suspects_find(suspects *all, lightfield *f, place *at, char *const *pictures, const views *v,
                  const landmarks *l, int keep, errmsg *e);
void suspects_free(suspects *all);

#endif
