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
    int rows;     /* rows from the top down to the last one that anything is seen in; 0: nothing is */
    double edge;  /* polar angle at which seeing ends: the last row counts by its mean share (radians) */
    double among; /* share of the probe's solid angle in the holes above */
} holes;

holes holes_find(const float *seen, int w, int h, double polar_max);

/* Rows from first on: holes get the value of the texel above.  first >= 1. */
void holes_hold(float *rgb, const float *seen, int w, int h, int first);

/* All holes get a smooth continuation of what is around them: the mean, by solid angle, of ever larger
 * surroundings.  What is seen stays.  -1: out of memory; nothing is seen: nothing is done. */
int holes_fill(float *rgb, const float *seen, int w, int h, double polar_max);

#endif
