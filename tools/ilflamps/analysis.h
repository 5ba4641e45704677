/*
 * analysis.h - from a light field to lamps, what hides them, and what is left: ilflamps' whole job, without
 * files but the input.
 */
#ifndef ANALYSIS_H
#define ANALYSIS_H

#include "blur.h"
#include "model.h"
#include "steady.h"
#include "surroundings.h"

typedef struct plan {
    int most;           /* lamps to take out at most */
    double max_width;   /* wider ones stay in the field, radians */
    const char *octree; /* the surroundings, or NULL: a box estimated from the probes */
} plan;

/* What became of a lamp. */
typedef enum fate { TAKEN, TOO_WIDE, UNEXPLAINED, SHAPELESS } fate;

typedef struct found {
    lamp l; /* l.s.l has its masks */
    fate fate;
    model best;           /* chosen; its folds are kept for those who want to check */
    double interpolation; /* held-out error of bilinear interpolation */
} found;

typedef struct analysis {
    lightfield f; /* the residual */
    found *lamps;
    int n;     /* all found; those TAKEN are out of the field */
    int spots; /* bright spots, and how many of them belong to no lamp */
    int stray;
    surroundings around;
    steadied steady; /* probes that were turned; measured = 0: none was */
    blurred blur;    /* of the pictures; lamps = 0: none */
    double cpu_s;
} analysis;

int analyse(analysis *a, const char *path, const plan *p, errmsg *e);

/* The same of a light field in memory, which is the analysis' from now on, also where it fails. */
int analyse_field(analysis *a, lightfield *f, const plan *p, errmsg *e);
void analysis_free(analysis *a);

#endif
