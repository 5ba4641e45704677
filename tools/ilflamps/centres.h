/*
 * centres.h - where lamps hang: spots of several probes whose rays meet.
 */
#ifndef CENTRES_H
#define CENTRES_H

#include "blobs.h"

typedef struct centre {
    double at[3];
    int far;          /* at infinity: stands at a distance of FAR_AWAY sizes of the plane */
    int seen;         /* probes that see some of it */
    double brightest; /* largest flux x distance^2 */
    double sigma;     /* standard error of the position, scene's unit */
} centre;

#define FAR_AWAY 1000.

/* The lamps, brightest first, at most `most`; spots get their lamp's number.  c: room for `most`.  Returns
 * their number. */
int centres_find(centre *c, int most, bloblist *list, const lightfield *f);

/* The same lamp's place again from its spots, whose directions have changed. */
void centres_again(centre *c, int number, const bloblist *list, const lightfield *f);

#endif
