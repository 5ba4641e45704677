/*
 * fewer.h - what is left in the probes, on a coarser grid: with lamps taken out it is smooth from place to place.
 */
#ifndef FEWER_H
#define FEWER_H

#include "analysis.h"

typedef struct fewplan {
    int nu, nv;   /* probes to keep along u and v; 0: as few as the error allows */
    double error; /* largest error of irradiance, a share */
} fewplan;

/* A coarser grid and how far its light is from the whole one's, by probes that were left out of it. */
typedef struct fewer {
    lightfield f;       /* its probes */
    int *nearest;       /* of each, the whole grid's probe beside it */
    int same;           /* nothing coarser did: f is empty, all probes stay */
    int places;         /* where it was compared, at HEIGHTS, up and to four sides */
    double rms, worst;  /* of irradiance, of its mean over the places in such orientations */
    int less_u, less_v; /* the next coarser grid that was tried and failed, and its worst; 0: none was */
    double less_worst;
} fewer;

/* Keep as few probes as the plan says.  The surroundings, where they are known, tell what a probe between two others sees.
 * *w is the caller's until fewer_free, also where it fails. */
int fewer_find(fewer *w, const analysis *a, const fewplan *p, errmsg *e);
void fewer_say(const fewer *w, const fewplan *p, const lightfield *whole, const char *path);
void fewer_free(fewer *w);

#endif
