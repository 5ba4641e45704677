/*
 * judge.h - which surface predicts best what pictures show that had no part in it.
 */
#ifndef JUDGE_H
#define JUDGE_H

#include "box.h"
#include "shell.h"

typedef enum surface_kind { SURFACE_BOX, SURFACE_MIXED, SURFACE_FREE, SURFACE_FAR, SURFACES } surface_kind;

extern const char *const judge_names[SURFACES];

typedef struct surface {
    surface_kind kind;
    const box *box;     /* SURFACE_BOX */
    const shell *shell; /* SURFACE_MIXED, SURFACE_FREE; SURFACE_FAR: infinitely far away, for comparison */
} surface;

typedef struct verdict {
    int rays;               /* judged; 0: no pictures were held */
    double error[SURFACES]; /* mean difference of features, below 0: not tried */
    double
        better[SURFACES]; /* than the one before it that was best: mean difference over its standard error */
    surface_kind best;
} verdict;

/* Nearness of a surface along a direction (unit) from o. */
double surface_near(const surface *f, const double o[3], const double d[3]);

/* Predict held pictures as a renderer would: from the four nearest others, each looked up towards the point on the
 * surface.  f: n surfaces, the simplest
 * first; a less simple one must be better by 3 % and by twice the standard error.  Without held pictures the first is best.
 * Rays that meet a thing marked in `things` (NULL: none) don't count. */
int judge_surfaces(verdict *v, const surface *f, int n, const shell *things, const views *s,
                   const sweep_plan *p, errmsg *e);

#endif
