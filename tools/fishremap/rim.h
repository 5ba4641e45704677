/*
 * rim.h - one circle in a picture: where its rim is, and how well it shows.  Pure.
 *
 * A rim is an edge all around: along it the picture's gradient points to the centre or away from it, whatever
 * its strength.
 *
 *      t = (2 d^2 - |g|^2) / (|g|^2 + FAINT^2),   d = g . (direction from the centre)
 *
 * is cos 2a, a the angle between gradient and radius: 1 along a rim, 0 on average where the picture knows
 * nothing of the circle, -1 where edges cross it.  The brightness is a logarithm, so a lamp does not outvote
 * a faint rim.
 */
#ifndef RIM_H
#define RIM_H

#include "base/errmsg.h"
#include "circle.h"

/* A picture's brightness (circle_grey) at one scale, and its gradient. */
typedef struct rim_level {
    int w, h;
    double kx, ky; /* pixels of the picture per pixel here */
    float *g, *gx, *gy;
} rim_level;

enum { RIM_LEVELS = 8 };

/* The same at ever smaller scales: level[0] with the longer side of `side` pixels, or the picture's own if
 * that is less; each next one half of it; n of them, the last with a longer side of 64 or less. */
typedef struct rim_pyramid {
    rim_level level[RIM_LEVELS];
    int n;
} rim_pyramid;

/* g: w x h, as circle_grey gives it; -1: words in e, nothing to free. */
int rim_pyramid_new(rim_pyramid *p, const float *g, int w, int h, int side, errmsg *e);
void rim_pyramid_free(rim_pyramid *p);

/* Brightness at a point (bilinear); NaN outside. */
float rim_grey(const rim_level *l, double x, double y);

/* Mean of t over the visible part of a circle (pixels of the level), -1..1, less the more of it is out of
 * sight. */
double rim_score(const rim_level *l, circle_kind kind, double x, double y, double r);

/* Uphill in rim_score, in steps from `from` down to a fifth of a pixel; the score. */
double rim_climb(double c[3], const rim_level *l, circle_kind kind, int free_radius, double from);

/* What a circle is worth. */
typedef struct rim_fit {
    double x, y, r;         /* fitted; pixels of the level */
    double seen;            /* share of the circumference that lies in the picture */
    double share;           /* of what lies in the picture: where an edge follows the circle */
    double rms;             /* of the rim about the circle, share of the radius */
    double oval;            /* half the difference of its axes, share of the radius */
    double contrast;        /* across it, median, log units */
    double along;           /* mean t on the rim */
    double inside, outside; /* mean t just inside and just outside of it */
} rim_fit;

/* Trace the rim within `band` (share of the radius) of the circle, and fit.  -1: hardly anything to see. */
int rim_trace(rim_fit *f, const rim_level *l, circle_kind kind, int free_radius, const double c[3],
              double band);

#endif
