/*
 * circlelook.h - the circle that stands out most in one copy of a picture, and what it is worth.  Pure.
 */
#ifndef CIRCLELOOK_H
#define CIRCLELOOK_H

#include "base/errmsg.h"
#include "circle.h"

typedef struct circle_look {
    int any;        /* there is one; else the rest is 0 */
    circle_found f; /* pixels of the copy */
    double
        by_chance; /* 1 or more: what strength it can have by chance, the more the fewer pixels its rim has */
    double outside; /* mean t of the rings just around it (rim.h) */
    double nested;  /* mean t of the rings within it */
    double within;  /* strength of the best circle in it about the same centre, share of its own */
} circle_look;

/* grey: w x h, as circle_grey gives it.  radius: known, in pixels of the copy, or 0: from 3 % of the shorter
 * side up. -1: words in e. */
int circle_look_at(circle_look *o, const float *grey, int w, int h, circle_kind kind, double radius,
                   errmsg *e);

#endif
