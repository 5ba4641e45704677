/*
 * positions.h - where pictures were taken: a text file, a line a picture.
 *
 *     picture x y z heading [pitch roll]      # scene's unit, degrees; names with blanks in "quotes"
 *
 * heading is that of the picture's middle, counter-clockwise from +x about +z; then pitch (nose up), then
 * roll (right side down). Angles that are missing are 0.
 */
#ifndef POSITIONS_H
#define POSITIONS_H

#include "base/errmsg.h"

typedef struct place {
    char *name;
    int line; /* of the file, from 1 */
    double at[3];
    double heading, pitch, roll; /* degrees */
} place;

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

/* Unit vectors forward, left, up of a place's picture, in the scene's coordinates. */
void place_axes(double axes[3][3], const place *p);

/* A place's angles from its axes. */
void place_angles(place *p, const double axes[3][3]);

#endif
