/*
 * views.h - pictures for comparing: luminance, coarser and coarser, without what is too bright to be a wall.
 */
#ifndef VIEWS_H
#define VIEWS_H

#include "ilflamps/lightfield.h"

enum { LEVELS = 4 };

/* One level of all pictures of a field; maps as the field's, with larger texels. */
typedef struct view {
    int nt, np;
    double dt, dp;
    float *lum; /* n*np*nt; NAN where a lamp shines */
} view;

typedef struct views {
    const lightfield *f; /* its places and turns are asked for at each look */
    int n;               /* levels; level 0 is the finest */
    view v[LEVELS];
} views;

/* limit: luminance that no wall has. */
int views_make(views *v, const lightfield *f, double limit, errmsg *e);
void views_free(views *v);

/* Luminance in a direction (field's coordinates, any length), bilinear; NAN where it isn't known. */
double views_look(const views *v, int level, int probe, const double d[3]);

#endif
