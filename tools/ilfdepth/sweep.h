/*
 * sweep.h - what the parts of a sweep share: costs of hypotheses, their best paths, their refinement.
 */
#ifndef SWEEP_H
#define SWEEP_H

#include "depthmap.h"
#include "feature.h"

/* One source as the map's place sees it: a point at nearness r in direction d lies towards d + r shift from it. */
typedef struct source {
    const view *v;
    float shift[3];
} source;

typedef struct sweep {
    const views *s;
    const sweep_plan *p;
    depthmap *m;
    source source[MOST_SOURCES];
    float (*dir)[3];     /* per cell */
    float (*feature)[4]; /* per cell, of the map's own picture */
    float *cost;         /* per cell and level: mean difference over the sources, each bounded */
    float *sum;          /* the same along best paths */
    float noise;         /* of the least costs */
} sweep;

/* The parts of a sweep that every look at a map needs: sources (the map's), directions, features; free with sweep_end. */
int sweep_begin(sweep *w, errmsg *e);
void sweep_end(sweep *w);

float sweep_level(const sweep *w, double level); /* its nearness */

/* Mean bounded difference between the picture's feature in a direction and the sources' at nearness r. */
float sweep_cost(const sweep *w, const float d[3], const float f[4], float r);

/* Sums of costs along paths from all sides that end in a cell; steps between levels cost something (semi-global matching,
 * Hirschmueller 2008). */
int paths_sum(sweep *w, errmsg *e);

/* The normal equation a (r' - r) = b of a nearness: sources' features linearised between r - delta and r + delta; what differs by
 * more than about scale counts less. */
typedef struct equation {
    float a, b;
} equation;
void refine_linearise(equation *q, const sweep *w, const float d[3], const float f[4], float r, float delta,
                      float scale);

/* From the best level to a nearness between levels: linearised differences, and smoothness where there is nothing to
 * see.  Fills near and error. */
int refine_map(sweep *w, errmsg *e);

#endif
