/*
 * process.h - from pictures to maps of distances and a surface.
 */
#ifndef PROCESS_H
#define PROCESS_H

#include "judge.h"
#include "mesh.h"

typedef struct process {
    views s;
    sweep_plan p;
    int *held;
    depthmap *maps; /* one a picture */
    box b;
    shell mixed, free;
    verdict v;
    mesh m;
    double things,
        thing; /* share of solid angle where something stands before the box, and the nearest such distance (5 %) */
    double cpu_s;
} process;

typedef struct process_plan {
    double near; /* 0: from the positions */
    int width;   /* 0: from the pictures */
    int asked;   /* surface_kind, or -1: as judged */
    int things;  /* 1: things that hang in the room stay in the surface */
} process_plan;

/* Sweep and fit; q->s is read before.  *q is the caller's until process_free, also on failure. */
int process_run(process *q, const process_plan *plan, errmsg *e);
void process_free(process *q);

#endif
