/*
 * ilf_hemi.h - the hemisphere above the plane as a square of cells of equal solid angle.
 *
 * A direction (u, v, n) with n = 1 - r^2 goes to the disc point r (cos, sin)(theta) (equal areas: d omega =
 * dn dtheta = 2 r dr dtheta), the disc to the square by Shirley and Chiu's concentric map (1997).  Both are
 * continuous, and no stretch exceeds ILF_HEMI_STRETCH.
 */
#ifndef ILF_HEMI_H
#define ILF_HEMI_H

#include <math.h>

/* Largest change of the square's coordinates ([-1, 1]^2) per radian: radially at most 1/sqrt(2), around at
 * most (4/pi) times 1 (at the horizon), together below 1.5. */
#define ILF_HEMI_STRETCH 1.5

/* Square to direction: a, b in [-1, 1]. */
static inline void ilf_square_to_hemi(double d[3], double a, double b)
{
    /* within an octant the angle stays below pi/4, where a few terms of the series do (1e-12) */
    const int across = fabs(a) <= fabs(b);
    const double r = across ? b : a, t = r == 0 ? 0 : (across ? a : b) / r, x = 0.78539816339744831 * t,
                 z = x * x;
    const double sine =
        x * (1 + z * (-1. / 6 + z * (1. / 120 + z * (-1. / 5040 + z * (1. / 362880 - z * (1. / 39916800))))));
    const double cosine =
        1 +
        z * (-1. / 2 +
             z * (1. / 24 + z * (-1. / 720 + z * (1. / 40320 + z * (-1. / 3628800 + z * (1. / 479001600))))));
    const double s = r * sqrt(2 - r * r);

    d[0] = s * (across ? sine : cosine);
    d[1] = s * (across ? cosine : sine);
    d[2] = 1 - r * r;
}

/* Unit direction to square; below the horizon counts as on it. */
static inline void ilf_hemi_to_square(double *a, double *b, const double d[3])
{
    const double n = d[2] > 0 ? d[2] : 0, r = sqrt(1 - (n < 1 ? n : 1));
    const double x = fabs(d[0]), y = fabs(d[1]);
    /* angle within the octant, 0 at the axis, 1 at the diagonal */
    const double hi = x > y ? x : y, lo = x > y ? y : x;
    const double t = hi > 0 ? atan(lo / hi) * 1.27323954473516268 : 0;
    const double big = r, small = r * t;

    *a = copysign(x > y ? big : small, d[0]);
    *b = copysign(x > y ? small : big, d[1]);
}

#endif
