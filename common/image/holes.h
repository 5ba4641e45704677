/*
 * holes.h - directions that a latitude/longitude probe did not see.
 *
 * A probe is w columns of azimuth (which wraps) by h rows of polar angle, from 0 at the top to polar_max in
 * equal steps. seen[y*w + x] is the share of a texel that was seen: what is above 0 has a value of its own, 0
 * (or NaN) is a hole.
 */
#ifndef HOLES_H
#define HOLES_H

typedef struct holes {
    int rows;     /* rows above the rim; h: there is none; 0: nothing is seen at all */
    double edge;  /* polar angle of the rim, where seeing all round ends: its row counts by its mean share */
    double among; /* share of the probe's solid angle in the holes above the rim */
} holes;

/* The rim of a lens: below the last row that is seen (nearly) all round.  rim 0: don't look for one. */
holes holes_find(const float *seen, int w, int h, double polar_max, int rim);

/* Beyond the rim (rows, as found, >= 1) holes get the value of the texel above. */
void holes_hold(float *rgb, const float *seen, int w, int h, int rows);

/* All holes get a smooth continuation of what is around them: the mean, by solid angle, of ever larger
 * surroundings.  What is seen stays.  -1: out of memory; nothing is seen: nothing is done. */
int holes_fill(float *rgb, const float *seen, int w, int h, double polar_max);

#endif
