/*
 * outcome.h - what came out of a job, for the caller to print and for --report (report.h).
 */
#ifndef OUTCOME_H
#define OUTCOME_H

#include <stdint.h>

#include "circle.h"
#include "sphere.h"

typedef struct outcome {
    double cx, cy, radius;                         /* of the image circle, pixels */
    circle_found circle;                           /* how well it was found; r 0: it was given */
    int64_t bad_pixels;                            /* NaN, infinite or masked */
    double covered;                                /* share of the output's solid angle */
    double cpu_plan_s, cpu_prepare_s, cpu_remap_s; /* plan: only where several pictures share one */
    double pitch, polar_valid_deg, tilt_deg;       /* arrays */
    sphere_seen *spheres;                          /* arrays: where they are; the caller frees them */
    int nspheres;
    const char *spheres_from; /* "rims": fitted to all of them; "corners": as those say; pitch and tilt
                                 follow.  NULL for no array */
    int rims_seen;            /* rims within a pixel of the grid */
    double rims_rms;          /* of the spheres' own rims about it, pixels */
    double second_gain, second_residual,
        second_overlap; /* a second view's or circle's factor; relative deviation, robust; steradians */
    double
        second_colour[3];   /* by what more a second circle's colours would have to be multiplied; 1: alike */
    sphere_seen circles[2]; /* two circles in one picture; r 0: none */
    double circle_half_deg[2]; /* half their field of view */
    char remark[1024];         /* worth telling, or "" */
} outcome;

/* Add to the remarks. */
void outcome_note(outcome *o, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

#endif
