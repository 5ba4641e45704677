/*
 * surroundings.h - how far away the room's walls are, as seen from the plane's middle.
 *
 * From an octree (by rtrace), else a box estimated from the probes: their pictures of the same point of a
 * wall should agree.
 */
#ifndef SURROUNDINGS_H
#define SURROUNDINGS_H

#include "lightfield.h"

typedef struct surroundings {
    int nt, np; /* a map as of one probe, upper hemisphere */
    double centre[3];
    float *far;    /* distance from the centre */
    int measured;  /* 1: from an octree */
    double box[6]; /* else: x0 x1 y0 y1 height, and the mean mismatch (log) */
} surroundings;

int surroundings_from(surroundings *s, const char *octree, const lightfield *f, errmsg *e);
int surroundings_guess(surroundings *s, const lightfield *f, errmsg *e);
/* Rays (six doubles each: origin, direction; scene's coordinates) through rtrace: `each` floats a ray, of what
 * its option `what` names (-oL: distance). */
int surroundings_rtrace(float *got, int each, const char *what, const double *rays, int n, const char *octree,
                        errmsg *e);
void surroundings_free(surroundings *s);

/* Where a ray from o meets them (field's coordinates). */
void surroundings_meet(double x[3], const surroundings *s, const double o[3], const double d[3]);

#endif
