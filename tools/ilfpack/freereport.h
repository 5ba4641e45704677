/*
 * freereport.h - what was found of free pictures, as JSON.
 */
#ifndef FREEREPORT_H
#define FREEREPORT_H

#include "positions.h"
#include "refine.h"
#include "regrid.h"

typedef struct freefacts {
    const char *positions;
    char **pictures;
    const place *at;      /* where they stand, as given or refined */
    const refined *poses; /* corrections */
    int n, n_u, n_v;
    const double *plane; /* nine numbers */
    const reach *nodes;  /* n_u*n_v */
} freefacts;

/* Pictures and nodes in the scene's unit and degrees; lamps as ilflamps reports them. */
int freereport_write(const char *path, const freefacts *f, const analysis *a, errmsg *e);

#endif
