/*
 * freepack.h - pictures taken anywhere, to one light field: ilfpack --positions.
 */
#ifndef FREEPACK_H
#define FREEPACK_H

#include "positions.h"
#include "refine.h"
#include "shots.h"

typedef struct freeplan {
    const char *positions; /* file */
    const double *plane;   /* nine numbers, or NULL: what the positions support */
    int n_u, n_v;          /* 0: what they support */
    const char *octree;    /* the surroundings, or NULL: a box estimated from the pictures */
    int keep_lamps;        /* 1: lamps stay in the probes (version 1) */
    refining refine;
    shotplan how;
    const char *report; /* JSON, or NULL */
    const char *target;
    ilf_type type;
    const char *compression;
    int interleave;
    double tolerance; /* texels are rounded within it; 0: they are not */
    const char *line; /* the command line */
} freeplan;

/* Everything that can be said before a picture is read: the file, its names, the plane.  n = 0: the pictures
 * are those that the file names. */
int freepack_check(const freeplan *p, char *const *pictures, int n, errmsg *e);

/* Do it.  Words go to cli_note and cli_progress. */
int freepack(const freeplan *p, char *const *pictures, int n, errmsg *e);

#endif
