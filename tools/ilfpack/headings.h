/*
 * headings.h - headings that nobody wrote down, from one lamp that the pictures see.
 *
 * How high a lamp stands in a level picture does not depend on its heading: so the elevations at the given
 * places say where it hangs, and its azimuth in each picture which way that one looked. Which spots belong to
 * one lamp comes out of the same search: those whose elevations agree.
 */
#ifndef HEADINGS_H
#define HEADINGS_H

#include "ilflamps/lightfield.h"
#include "positions.h"

typedef struct headings {
    int n;          /* that were asked for */
    double lamp[3]; /* field's coordinates */
    double misfit;  /* of elevations, rms, radians */
} headings;

/* Find those of places that say so (place.unknown), and turn the field's pictures accordingly.  Needs four pictures
 * that see a lamp; refuses pictures that don't, and elevations that do not meet. */
int headings_find(headings *h, lightfield *f, place *at, char *const *pictures, const char *path, errmsg *e);

#endif
