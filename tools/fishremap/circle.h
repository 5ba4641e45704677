/*
 * circle.h - finding the image circle of a lens, or a mirror ball, in a picture.  Pure.
 *
 * The circle wanted is the one along which the logarithm of the picture changes most in the
 * radial direction, over as much of its visible circumference as possible (strong edges are
 * clipped, so that a lamp does not outvote the rim): searched over centre and radius on a small copy
 * of the picture, followed up to full size, and there fitted to the edge's sub-pixel positions.
 */
#ifndef CIRCLE_H
#define CIRCLE_H

#include "errmsg.h"

typedef enum circle_kind {
    CIRCLE_LENS, /* light inside, dark outside */
    CIRCLE_BALL  /* an edge of either sign */
} circle_kind;

typedef struct circle_found {
    double x, y, r;   /* pixels */
    double rms;       /* of the rim's positions about the circle, pixels */
    double share;     /* of the circumference: where the rim was seen and agrees */
} circle_found;

/* pix: 4 floats a pixel (R, G, B, alpha; alpha < 1/2 not used).  radius: known radius in pixels, or 0.
 * Parts of the circle may lie outside the picture.  Fails where no circle stands out. */
int circle_find(circle_found *f, const float *pix, int w, int h, circle_kind kind, double radius, errmsg *e);

/* Improve a circle that is known to about `slack` pixels: rim positions within the slack, robust fit.
 * Returns -1 (f untouched) where too little of the rim shows. */
int circle_refine(circle_found *f, const float *grey, int w, int h, circle_kind kind, double slack);

/* Logarithm of the brightness, as the functions here use it; malloc'd, NULL without memory. */
float *circle_grey(const float *pix, int w, int h);

#endif
