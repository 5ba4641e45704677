/*
 * shell.h - the surroundings as one distance for each direction from the middle of the positions.
 *
 * Nodes: columns round (azimuth -pi + i 2 pi/columns), rows from the pole to the horizon, or to the lower pole where pictures
 * show what is below (both ends included; at a pole all columns are one).  Closed by what it is; nodes that no map tells
 * are filled from those round them.
 */
#ifndef SHELL_H
#define SHELL_H

#include "depthmap.h"

typedef struct shell {
    double c[3];
    int columns, rows;
    double polar_max;      /* of the last row */
    float *near, *error;   /* nearness and its standard error */
    unsigned char *closed; /* 1: no map tells */
} shell;

/* From maps without those held: near, or (swept) what was found without a box. */
int shell_fuse(shell *h, const depthmap *maps, int n, int swept, const views *s, const sweep_plan *p, errmsg *e);
void shell_free(shell *h);

/* Nearness of the shell along a direction (unit) from o within it; 0: it is not met. */
double shell_near(const shell *h, const double o[3], const double d[3]);

/* Direction of a node. */
void shell_direction(double d[3], const shell *h, int column, int row);

#endif
