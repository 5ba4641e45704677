/*
 * slope.h - a picture made ready for the conservative remap, and the plane inside each pixel, made as it is
 * met.
 *
 * The slope along x is the central difference where the picture is smooth, limited so that the plane
 * stays between the neighbours' values (monotonised central limiter, van Leer 1977); likewise y.  The
 * pixel's mean is untouched and radiance stays >= 0.
 */
#ifndef SLOPE_H
#define SLOPE_H

#include <stdint.h>

#include "base/errmsg.h"
#include "chart.h"

/* A picture made ready.  pix: R G B and 1, or 0 for a bad pixel. */
typedef struct remap_source {
    int width, height;
    const float *pix;   /* width*height*4, the caller's */
    unsigned char *bad; /* 1: pixel can't be used (NaN, infinite, masked); NULL if there is none; owned */
    int64_t nbad;
} remap_source;

/* pix: width*height*4, R G B alpha, 16-byte aligned (malloc's are); it is used up, and stays in use by s:
 * pixels that are NaN, infinite or have alpha < 1/2 are marked bad, blackened and take no part.  Pixels that
 * the rim of a disc cuts mix with what lies outside and take the value of the next pixel inwards.  all_good:
 * the caller knows that every pixel is finite and has alpha 1.  -1: no memory. */
int source_clean(remap_source *s, float *pix, int width, int height, int all_good, const chart *src,
                 errmsg *e);
void source_free(remap_source *s);

typedef float slope_v4 __attribute__((vector_size(16)));
typedef int slope_i4 __attribute__((vector_size(16)));

static inline slope_v4 slope_abs(slope_v4 a)
{
    return (slope_v4)((slope_i4)a & 0x7fffffff);
}

#ifdef __SSE__ /* the compiler does not find its min and max in the vector form below */
#include <xmmintrin.h>
static inline slope_v4 slope_min(slope_v4 a, slope_v4 b)
{
    return (slope_v4)_mm_min_ps((__m128)a, (__m128)b);
}

static inline slope_v4 slope_max(slope_v4 a, slope_v4 b)
{
    return (slope_v4)_mm_max_ps((__m128)a, (__m128)b);
}

static inline int slope_any(slope_i4 a)
{
    return _mm_movemask_ps((__m128)a);
}
#else
static inline slope_v4 slope_min(slope_v4 a, slope_v4 b)
{
    slope_i4 less = a < b;
    return (slope_v4)(((slope_i4)a & less) | ((slope_i4)b & ~less));
}

static inline slope_v4 slope_max(slope_v4 a, slope_v4 b)
{
    return -slope_min(-a, -b);
}

static inline int slope_any(slope_i4 a)
{
    return (a[0] | a[1] | a[2] | a[3]) != 0;
}
#endif

/* Slope from the differences to the left and to the right: what is least of their mean and twice each, 0
 * where they differ in sign. */
static inline slope_v4 slope_limited(slope_v4 a, slope_v4 b)
{
    const slope_v4 zero = {0, 0, 0, 0};
    slope_v4 c = 0.5f * (a + b), low = slope_min(a, b), high = slope_max(a, b);
    return slope_max(slope_min(low + low, c), zero) + slope_min(slope_max(high + high, c), zero);
}

/* Both slopes of a pixel from its four neighbours; its lowest corner stays >= 0. */
static inline void slope_pixel(slope_v4 *gx, slope_v4 *gy, slope_v4 p, slope_v4 left, slope_v4 right,
                               slope_v4 up, slope_v4 down)
{
    slope_v4 x = slope_limited(p - left, right - p), y = slope_limited(p - up, down - p);
    slope_v4 dip = 0.5f * (slope_abs(x) + slope_abs(y));
    slope_i4 low = dip > p;
    if (slope_any(low)) /* of the fourth channel both are 0 and 1 */
        for (int c = 0; c < 3; c++) {
            float k = !low[c] ? 1 : p[c] > 0 ? p[c] / dip[c] : 0;
            x[c] *= k, y[c] *= k;
        }
    *gx = x, *gy = y;
}

/* The same of pixel (x, y) of a picture; wrap: its first and last column are neighbours.  Beside a bad pixel
 * it is level; all_good: there is none. */
static inline void slope_at(slope_v4 *gx, slope_v4 *gy, const remap_source *s, int x, int y, int wrap,
                            int all_good)
{
    const size_t w = (size_t)s->width;
    const slope_v4 *c = (const slope_v4 *)s->pix + (size_t)y * w + (size_t)x;
    slope_v4 p = *c,
             left = x > 0  ? c[-1]
                    : wrap ? c[w - 1]
                           : p,
             right = x + 1 < s->width ? c[1]
                     : wrap           ? *(c - (w - 1))
                                      : p;
    slope_v4 up = y > 0 ? *(c - w) : p, down = y + 1 < s->height ? c[w] : p;
    if (!all_good && (left[3] == 0 || right[3] == 0)) left = right = p;
    if (!all_good && (up[3] == 0 || down[3] == 0)) up = down = p;
    slope_pixel(gx, gy, p, left, right, up, down);
}

#endif
