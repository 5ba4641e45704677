/*
 * fisheye.h - where a point of the virtual camera's picture looks.
 *
 * The picture is square, size x size pixels, (0, 0) its top-left corner, y down; the image circle touches
 * its edges.  The camera stands on the plane and looks along n = u x v with +v up, so +u is to the
 * left (docs/FORMAT.md, section 1.4), as in a Radiance view with -vd n -vu v.
 *
 * This is written apart from fishremap's lens models on purpose: a virtual capture would prove nothing
 * if both ends of the chain shared one error.
 */
#ifndef FISHEYE_H
#define FISHEYE_H

#include "base/errmsg.h"

typedef enum fisheye_lens {
    LENS_EQUIDISTANT,
    LENS_EQUISOLID,
    LENS_STEREOGRAPHIC,
    LENS_ORTHOGRAPHIC
} fisheye_lens;

typedef struct fisheye {
    fisheye_lens lens;
    double half_fov; /* radians; angle from the axis at the image circle */
    int size;        /* pixels */
} fisheye;

typedef struct camera_frame {
    double pos[3];
    double u[3], v[3], n[3]; /* unit vectors, world space */
} camera_frame;

int fisheye_make(fisheye *f, const char *lens, double fov_deg, int size, errmsg *e);

/* Angle from the axis at distance rho from the centre, in radii of the image circle (0..1). */
double fisheye_theta(const fisheye *f, double rho);

/* Unit direction in world space at picture point (x, y) in pixels; *theta_rad may be NULL.
 * Returns 0 outside the image circle, else 1. */
int fisheye_direction(double d[3], double *theta_rad, const fisheye *f, const camera_frame *c, double x,
                      double y);

/* The plane rectangle O, U, V (docs/FORMAT.md, section 1.3) as a frame at grid node (i, j) of n x m ... */
int camera_at_node(camera_frame *c, const double plane[9], const int grid[2], const int node[2], errmsg *e);
/* ... or at lengths (x, y) along u and v from O. */
int camera_at_point(camera_frame *c, const double plane[9], const double xy[2], errmsg *e);

#endif
