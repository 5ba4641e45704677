/*
 * vec3.h - three numbers at a time.
 */
#ifndef VEC3_H
#define VEC3_H

#include <math.h>

static inline double v3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double v3_len(const double a[3])
{
    return sqrt(v3_dot(a, a));
}

/* r = a + s b */
static inline void v3_add(double r[3], const double a[3], double s, const double b[3])
{
    for (int c = 0; c < 3; c++) r[c] = a[c] + s * b[c];
}

/* r = M a, M's rows being unit vectors: a in their coordinates; r is not a. */
static inline void v3_into(double r[3], const double m[3][3], const double a[3])
{
    for (int c = 0; c < 3; c++) r[c] = v3_dot(m[c], a);
}

/* r = transposed M a: back again; r is not a. */
static inline void v3_back(double r[3], const double m[3][3], const double a[3])
{
    for (int c = 0; c < 3; c++) r[c] = m[0][c] * a[0] + m[1][c] * a[1] + m[2][c] * a[2];
}

#endif
