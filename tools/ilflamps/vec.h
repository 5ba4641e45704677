/*
 * vec.h - three numbers as a vector.
 */
#ifndef VEC_H
#define VEC_H

#include <math.h>

static inline double v_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double v_len(const double a[3])
{
    return sqrt(v_dot(a, a));
}

static inline void v_sub(double r[3], const double a[3], const double b[3])
{
    for (int k = 0; k < 3; k++) r[k] = a[k] - b[k];
}

static inline void v_cross(double r[3], const double a[3], const double b[3])
{
    r[0] = a[1] * b[2] - a[2] * b[1];
    r[1] = a[2] * b[0] - a[0] * b[2];
    r[2] = a[0] * b[1] - a[1] * b[0];
}

/* Unit vector; returns the length that it had. */
static inline double v_unit(double a[3])
{
    const double l = v_len(a);

    if (l > 0)
        for (int k = 0; k < 3; k++) a[k] /= l;
    return l;
}

/* Unit vectors x, y at right angles to the unit vector n. */
static inline void v_basis(double x[3], double y[3], const double n[3])
{
    const double up[3] = {0, 0, 1}, side[3] = {1, 0, 0};

    v_cross(x, fabs(n[2]) < .9 ? up : side, n);
    v_unit(x);
    v_cross(y, n, x);
}

/* Turn v about the unit vector axis, counter-clockwise, by an angle in radians (Rodrigues' formula). */
static inline void v_rotate(double v[3], const double axis[3], double angle)
{
    double x[3];
    const double c = cos(angle), s = sin(angle), k = v_dot(axis, v) * (1 - c);

    v_cross(x, axis, v);
    for (int i = 0; i < 3; i++) v[i] = c * v[i] + s * x[i] + k * axis[i];
}

#endif
