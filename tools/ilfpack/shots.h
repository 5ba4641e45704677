/*
 * shots.h - pictures that were taken anywhere, as a light field in memory (ilflamps/lightfield.h) whose
 * probes stand freely and are turned as their cameras were.
 */
#ifndef SHOTS_H
#define SHOTS_H

#include "ilflamps/lightfield.h"
#include "positions.h"

/* How pictures are taken. */
typedef struct shotplan {
    double polar_max; /* above 0: they are probes to this angle, radians; else their headers say what they
                          are, and what says nothing is an equirectangular panorama */
    int ignore_alpha;
    const char *layer; /* of OpenEXR pictures, or NULL */
    int most_rows;     /* finer panoramas are reduced by a whole factor, as near to this as it goes */
} shotplan;

/* What was found in them. */
typedef struct shotfacts {
    int probes;        /* 1: they are probes, whose axis x is their heading; else panoramas */
    int width, height; /* as stored */
    int factor;        /* by which they were reduced */
    double holes; /* largest share of a picture that was transparent (f->unseen); filled from around it */
    const char *holes_of;          /* that picture */
    char owner[256], cap_date[64]; /* the first picture's; "" */
    double white_luminance;        /* 0: not stated */
} shotfacts;

/* Load n pictures with their places (positions.h, in the same order) into a field on the given plane.  *f is
 * the caller's until lf_free. */
int shots_load(lightfield *f, shotfacts *facts, char *const *pictures, const place *at, int n,
               const ilf_frame *plane, const shotplan *how, errmsg *e);

/* A place as probe k of the field stands and is turned now; its name and line stay. */
void shots_place(place *at, const lightfield *f, int k);

/* Where probe k of the field stands and how it is turned, from its place. */
void shots_stand(lightfield *f, int k, const place *at);

#endif
