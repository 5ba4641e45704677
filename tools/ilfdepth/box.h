/*
 * box.h - a room as a box, if it is one: six planes at right angles.
 *
 * First fitted to what the sweeps found, robustly; then to the pictures themselves: places on the box should look alike from everywhere.
 */
#ifndef BOX_H
#define BOX_H

#include "depthmap.h"

typedef struct box {
    double c[3], axis[3][3]; /* middle of the positions; rows: the box's own axes */
    double side[6];          /* distances from c to the sides -x, +x, -y, +y, -z, +z, above 0 */
    int seen[6];             /* 0: no picture shows it; its distance is made up */
    double error[6];         /* standard errors, from fits without a fourth of the maps each */
    double explains;         /* share of solid angle that it explains to 5 % of the distance, as swept */
    int fitted;              /* 0: there is none */
} box;

/* Nearness of the box along a direction (unit) from o within it. */
double box_near(const box *b, const double o[3], const double d[3]);

/* Fit it to maps (those with held[view] don't count). */
int box_fit(box *b, const depthmap *maps, int n, const views *s, const sweep_plan *p, errmsg *e);

/* In each map the box takes over where it explains the pictures as well as the sweep does. */
int box_compete(depthmap *maps, int n, const box *b, const views *s, const sweep_plan *p, errmsg *e);

#endif
