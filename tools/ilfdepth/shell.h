/*
 * shell.h - the surroundings as one distance for each direction from the middle of the positions.
 *
 * Nodes: columns round (azimuth -pi + i 2 pi/columns), rows from the pole to the horizon, or to the lower pole where pictures
 * show what is below (both ends included; at a pole all columns are one).  Closed by what it is; nodes that no map tells
 * are filled from those round them.
 */
#ifndef SHELL_H
#define SHELL_H

#include "box.h"

typedef struct shell {
    double c[3];
    int columns, rows;
    double polar_max;      /* of the last row */
    float *near, *error;   /* nearness and its standard error */
    unsigned char *closed; /* 1: no map tells */
    unsigned char *thing;  /* 1: a thing that hangs in the room stands (stood) before the box there */
} shell;

/* From maps without those held: near, or (swept) what was found without a box. */
int shell_fuse(shell *h, const depthmap *maps, int n, int swept, const views *s, const sweep_plan *p,
               errmsg *e);
/* Mark the things that hang in the room before its box, as seen from the middle: patches of nodes that are nearer than the box and end in a
 * step nearly all round.  What stands on the floor or is a wall is none. */
int shell_mark_things(shell *h, const box *b, errmsg *e);

/* The box in place of the things marked in `from` (which may be h). */
void shell_drop_things(shell *h, const shell *from, const box *b);

void shell_free(shell *h);

/* Nearness of the shell along a direction (unit) from o within it; 0: it is not met. */
double shell_near(const shell *h, const double o[3], const double d[3]);

/* The node nearest to a direction (any length). */
int shell_node(const shell *h, const double d[3]);

/* Direction of a node. */
void shell_direction(double d[3], const shell *h, int column, int row);

#endif
