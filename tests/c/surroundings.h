/*
 * surroundings.h - auxiliary geometry for the drivers of libilf's sampling: at infinity, or a box or sphere
 * seen from inside, perhaps with a ball in it.
 */
#ifndef SURROUNDINGS_H
#define SURROUNDINGS_H

#include <math.h>

#include "base/cli.h"

typedef struct shape {
    double v[6]; /* centre and radius, or two corners */
    int there;
    int numbers;
} shape;

static shape box = {.numbers = 6}, sphere = {.numbers = 4}, ball = {.numbers = 4};

static int take_shape(const char *value, void *arg, errmsg *e)
{
    shape *s = arg;

    s->there = 1;
    return cli_parse_doubles(s->v, s->numbers, value, ", ", e);
}

#define SURROUNDINGS_OPTIONS                                                                                 \
    {"box", 0, CLI_CALL, &box, take_shape, "X0,Y0,Z0,X1,Y1,Z1", "surroundings: a box, inside"},              \
        {"sphere", 0, CLI_CALL, &sphere, take_shape, "X,Y,Z,R", "surroundings: a sphere, inside"},           \
        {"ball", 0, CLI_CALL, &ball, take_shape, "X,Y,Z,R", "a ball within the box or sphere"}

/* Where a ray goes into (side -1) or out of (side 1) a sphere; infinity if it misses. */
static double cross_sphere(const double o[3], const double d[3], const double s[4], int side)
{
    double a = 0, b = 0, c = -s[3] * s[3];

    for (int k = 0; k < 3; k++) {
        const double w = o[k] - s[k];
        a += d[k] * d[k];
        b += w * d[k];
        c += w * w;
    }
    const double disc = b * b - a * c;
    return disc > 0 ? (-b + side * sqrt(disc)) / a : HUGE_VAL;
}

/* The ball, or the way out of the box or sphere along a ray; 0 for a ray that starts outside and misses.  An
 * ilf_hit_fn. */
static int way_out(double hit[3], const double o[3], const double d[3], void *context)
{
    double t = HUGE_VAL;

    (void)context;
    if (sphere.there) t = cross_sphere(o, d, sphere.v, 1);
    else
        for (int k = 0; k < 3; k++) {
            if (d[k] == 0) continue;
            const double at = ((d[k] > 0 ? box.v[3 + k] : box.v[k]) - o[k]) / d[k];
            if (at < t) t = at;
        }
    if (ball.there) {
        const double at = cross_sphere(o, d, ball.v, -1);
        if (at > 0 && at < t) t = at;
    }
    if (!(t > 0 && isfinite(t))) return 0;
    for (int k = 0; k < 3; k++) hit[k] = o[k] + t * d[k];
    return 1;
}

#endif
