/*
 * circle.h - finding the image circle of a lens, or a mirror ball, in a picture.  Pure.
 *
 * The circle wanted is the one along which the logarithm of the picture changes in the radial direction, over
 * as much of its visible circumference as possible (rim.h).  Guesses come from several sources (circleseed.h)
 * on copies of one size, so that the picture's own matters little; each is traced and weighed, the best is
 * kept (circlelook.h).  It is refused where it is faint, not clearly better than another circle, nested in or
 * around another one, or elsewhere in a smaller or a softer copy.
 */
#ifndef CIRCLE_H
#define CIRCLE_H

#include "base/errmsg.h"

typedef enum circle_kind {
    CIRCLE_LENS, /* light inside, dark outside */
    CIRCLE_BALL  /* an edge of either sign */
} circle_kind;

typedef struct circle_found {
    double x, y, r;  /* pixels */
    double rms;      /* of the rim's positions about the circle, pixels */
    double share;    /* of the whole circumference: where an edge follows the circle */
    double seen;     /* of the circumference: what lies in the picture */
    double contrast; /* across the rim, median, log (base e) units */
    double strength; /* 0..1: how much of what is visible is a rim, less what is like one outside of it */
    double apart;    /* share of the radius: how far it lies off in a smaller and in a softer copy, and a part
                        of a pixel */
    double margin;   /* 0..1: by how much the next best other circle is worse */
} circle_found;

/* pix: 4 floats a pixel (R, G, B, alpha; alpha < 1/2 not used).  radius: known radius in pixels, or 0: from 3
 * % of the shorter side up.  Parts of the circle may lie outside the picture.  -1 where no circle stands out:
 * the words say what was found, and how to give it by hand (f is then that of the best, or untouched). */
int circle_find(circle_found *f, const float *pix, int w, int h, circle_kind kind, double radius, errmsg *e);

/* Logarithm of the brightness, as the functions here use it; malloc'd, NULL without memory. */
float *circle_grey(const float *pix, int w, int h);

#endif
