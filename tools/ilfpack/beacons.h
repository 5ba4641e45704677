/*
 * beacons.h - lamps that pictures see whole: directions that must meet.
 */
#ifndef BEACONS_H
#define BEACONS_H

#include "ilflamps/lightfield.h"

typedef struct sighting {
    int picture, lamp;
    double dir[3]; /* in the picture's own axes, unit */
} sighting;

typedef struct beacons {
    double (*at)[3]; /* lamps' places, field's coordinates */
    int lamps;
    sighting *s;
    int n;
} beacons;

/* From the bright spots of a field whose poses are nearly right. */
int beacons_find(beacons *b, const lightfield *f, errmsg *e);
void beacons_free(beacons *b);

#endif
