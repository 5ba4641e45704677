/*
 * feature.h - what a picture shows in a direction, as four numbers that can be compared between pictures, quickly.
 *
 * Features are the logarithms of R, G and B, and how far luminance (its logarithm) stands out of its neighbourhood:
 * the first tell smooth walls' places apart, the last is deaf to drifts of exposure.  They lie on the octahedral map
 * of the picture's sphere (no trigonometry in a lookup): nodes x nodes, the pole in the middle, the horizon a diamond.
 */
#ifndef FEATURE_H
#define FEATURE_H

#include <math.h>

#include "views.h"

/* Make the features of all views, no finer than texel (radians).  Returns -1 with words for want of memory. */
int feature_make(views *s, double texel, errmsg *e);

static const float FEATURE_NOTHING = -1e9f; /* of a node that the picture does not show */

/* Features in direction d (working coordinates, any length) of a picture; 0 where it shows nothing there. */
static inline int feature_look(float f[4], const view *v, const float d[3])
{
    float x = d[0], y = d[1], z = d[2];

    if (v->turned) {
        const float a = x, b = y, c = z;
        x = (float)v->axis[0][0] * a + (float)v->axis[0][1] * b + (float)v->axis[0][2] * c;
        y = (float)v->axis[1][0] * a + (float)v->axis[1][1] * b + (float)v->axis[1][2] * c;
        z = (float)v->axis[2][0] * a + (float)v->axis[2][1] * b + (float)v->axis[2][2] * c;
    }
    const float s = 1 / (fabsf(x) + fabsf(y) + fabsf(z) + 1e-30f);
    float p = x * s, q = y * s;
    if (z < 0) {
        const float t = p;
        p = copysignf(1 - fabsf(q), p), q = copysignf(1 - fabsf(t), q);
    }
    const float half = .5f * (float)(v->nodes - 1), px = (p + 1) * half, py = (q + 1) * half;
    int i = (int)px, j = (int)py;
    if (i > v->nodes - 2) i = v->nodes - 2;
    if (j > v->nodes - 2) j = v->nodes - 2;
    const float a = px - (float)i, b = py - (float)j;
    const float *n = v->feature + 4 * ((long)j * v->nodes + i), *m = n + 4L * v->nodes;
    for (int c = 0; c < 4; c++)
        f[c] = (1 - b) * ((1 - a) * n[c] + a * n[c + 4]) + b * ((1 - a) * m[c] + a * m[c + 4]);
    return f[0] > -1e3f;
}

/* How far two features differ. */
static inline float feature_differ(const float f[4], const float g[4])
{
    return (fabsf(f[0] - g[0]) + fabsf(f[1] - g[1]) + fabsf(f[2] - g[2])) * (1.f / 3) + fabsf(f[3] - g[3]);
}

#endif
