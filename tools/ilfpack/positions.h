/*
 * positions.h - where pictures were taken: a text file, a line a picture (base/place.h).
 */
#ifndef POSITIONS_H
#define POSITIONS_H

#include "base/errmsg.h"
#include "base/place.h"

typedef struct places {
    place *p;
    int n;
} places;

/* Read all of the file; free with places_free. */
int places_read(places *all, const char *path, errmsg *e);
void places_free(places *all);

/* Names of the pictures as the file has them, looked for beside it; *names and each of them malloc'd. */
int places_names(char ***names, const places *all, const char *path, errmsg *e);

/* Put all->p in the pictures' order: picture k's line is all->p[k], what lies beyond names no picture given.
 * A line means a picture by its whole name, else by its last part, else by that without its ending. */
int places_match(places *all, char *const *pictures, int n, const char *path, errmsg *e);

#endif
