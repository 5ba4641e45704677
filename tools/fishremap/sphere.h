/*
 * sphere.h - geometry of mirror-sphere arrays (paper, section 4.1).  Pure.
 *
 * A point of a sphere at angle a from the top reflects an orthographic camera above it to the
 * direction 2a.  A neighbour of equal size at centre distance 2k radii is just touched by that
 * reflected ray where  2k cos 2a + sin a = 1,  that is  4k s^2 - s - (2k - 1) = 0,  s = sin a;
 * k = 1: s = 0.6404, 2a = 79.64 degrees, the paper's 159.2 degrees in all.
 *
 *      camera        |   / 2a           the ray leaves P = (s, cos a), and passes the centre
 *        |           | /                (2k, 0) of the neighbour at one radius
 *        v    ___    P    ___
 *           /     \  . /     \
 */
#ifndef SPHERE_H
#define SPHERE_H

#include "base/errmsg.h"

/* A sphere as seen: centre and radius in pixels. */
typedef struct sphere_seen {
    double x, y, r;
} sphere_seen;

/* Half angle (radians) of the cone about the normal that neighbours leave free, from
 * pitch/diameter; pi/2 at most is approached for far neighbours.  NaN for a ratio below 1. */
double sphere_free_cone(double pitch_per_diameter);

/* The grid's homography: node (s, t), s in 0..n-1, t in 0..m-1, to pixels. */
typedef struct sphere_grid {
    int n, m;
    double h[9]; /* row-major, maps (s, t, 1) */
    double r[4]; /* radii at the corners, in corner order */
} sphere_grid;

/* From the corner spheres in the order (0,0), (n-1,0), (n-1,m-1), (0,m-1).  rotate: the
 * angle (radians) by which the picture is to be turned counter-clockwise to have +v up.  Refuses
 * corners that can't be right, and says which and why. */
int sphere_grid_init(sphere_grid *g, int n, int m, const sphere_seen corner[4], double rotate, errmsg *e);

/* The sphere at node (s, t), and the direction of +u in the picture there (radians,
 * counter-clockwise from right as seen). */
sphere_seen sphere_grid_at(double *u_angle, const sphere_grid *g, double s, double t);

/* Mean distance of neighbours, in diameters, as seen (0 for a single sphere). */
double sphere_grid_pitch(const sphere_grid *g);

#endif
