/*
 * lens.h - radial projection models: field angle <-> picture radius.
 *
 * A direction at field angle theta from the optical axis lands at radius r(theta) from the
 * centre of the image circle.  Everything here is normalised so that r(half) = 1, where half
 * is half the field of view: the picture's scale (radius in pixels) is the caller's.
 *
 *   equidistant    r ~ theta             stereographic  r ~ tan(theta/2)
 *   equisolid      r ~ sin(theta/2)      orthographic   r ~ sin(theta)
 *   polynomial     r ~ c1 theta + c2 theta^2 + ...   (theta in radians)
 *   kannala-brandt r = f (theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9)
 *   table          monotone cubic through given (theta, r)
 *   sphere         a mirror sphere as a lens, see below
 *
 * A mirror sphere seen from distance D (in radii, from its centre; 0 = infinitely far)
 * is a lens too.  theta is then the angle between the sphere-to-camera line and the
 * direction that a picture point reflects:
 *   tan(beta) = r tan(beta_rim), sin(i) = D sin(beta), theta = 2i - beta,
 * with beta the angle of the camera ray from that line, i the angle of incidence and
 * sin(beta_rim) = 1/D.  For D -> infinity theta = 2 asin(r): the equisolid lens of 360 degrees.
 *
 * Pure: no I/O (lensfile.h reads files).
 */
#ifndef LENS_H
#define LENS_H

#include "base/errmsg.h"

#define LENS_MAX_COEF  16
#define LENS_MAX_TABLE 512

typedef enum lens_kind {
    LENS_EQUIDISTANT,
    LENS_EQUISOLID,
    LENS_STEREOGRAPHIC,
    LENS_ORTHOGRAPHIC,
    LENS_POLYNOMIAL,
    LENS_TABLE,
    LENS_SPHERE
} lens_kind;

typedef struct lens {
    lens_kind kind;
    double half;  /* half the field of view, radians; r(half) = 1 */
    double scale; /* r = scale * model; set by lens_finish */
    /* What the model is made of. */
    int ncoef; /* polynomial: coef[k] multiplies theta^(k+1) */
    double coef[LENS_MAX_COEF];
    int ntable; /* table: angles (radians) from 0, radii, end slopes */
    double tab_t[LENS_MAX_TABLE], tab_r[LENS_MAX_TABLE], tab_m[LENS_MAX_TABLE];
    double distance; /* sphere: camera distance in radii, 0 = infinite */
    /* What a file may state besides (0 = not stated); pixels of the picture. */
    double focal_px, centre_px[2];
    double size_px[2];  /* of the picture that focal_px and centre_px are for */
    double tangential;  /* |(p1, p2)| of a pinhole camera whose terms were left out */
    double shape[2][2]; /* (right, up) = radius shape (r cos psi, r sin psi): what makes the circle an
                           ellipse; all 0: a circle */
    double
        from_first[9]; /* rows: turns a first camera's coordinates (x right, y down, z ahead) to this one's;
                             all 0: not stated */
} lens;

/* Kind from its name; -1 when it is none of the four that need no coefficients. */
int lens_kind_by_name(const char *name);

/* Set half, check the model over [0, half] and scale it.  The words say where the model
 * ends (orthographic 90, stereographic and equisolid below/at 180 degrees) or at what angle
 * it stops growing.  kind and coefficients must be set. */
int lens_finish(lens *l, double half, errmsg *e);

/* A camera matrix, OpenCV's: (0,0) in the middle of the first pixel. */
void lens_camera(lens *l, double fx, double fy, double cx, double cy, double skew);

/* The widest half angle of an unfinished model, radians: where a polynomial stops growing, a table ends, a
 * projection must. */
double lens_end(const lens *l);

/* A ready mirror sphere; distance in radii (> 1), or 0 for infinitely far. */
int lens_sphere(lens *l, double distance, errmsg *e);

/* Radius (1 at half) and its derivative per radian, from the same expression.  theta is
 * clamped to [0, half].  drdt may be NULL. */
double lens_radius(double *drdt, const lens *l, double theta);

/* The inverse, r clamped to [0, 1], to rounding (of r, or of the angle where the curve is steep): Newton
 * steps, and halved bounds wherever a step gains less than half. */
double lens_angle(const lens *l, double r);

/* Solid angle per area of picture (radius 1) at radius r: sin(theta) / (r dr/dtheta). */
double lens_solid_angle(const lens *l, double r);

#endif
