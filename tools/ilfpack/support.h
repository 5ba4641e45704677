/*
 * support.h - the grid that free positions support: a level rectangle about them, and a pitch like their
 * distances.
 */
#ifndef SUPPORT_H
#define SUPPORT_H

#include "ilf.h"
#include "positions.h"

/* The least rectangle along the scene's x and y that holds all places, at their mean height; plane: nine
 * numbers as --plane has them, rounded as a header holds them. */
int support_plane(double plane[9], const place *at, int n, const char *path, errmsg *e);

/* About as many nodes as there are places, about as far apart along u as along v. */
void support_grid(int *n_u, int *n_v, const ilf_frame *plane, int n);

/* Order places along a band that goes to and fro across the plane, so that numbers that follow each other are
 * near: folds of every fourth are spread.  pictures follow their places. */
void support_order(place *at, char **pictures, int n, const ilf_frame *plane);

#endif
