/*
 * exr_half.h - binary16, OpenEXR's HALF, to and from binary32.
 *
 * half_to_float_any and half_from_float are Imath's imath_half_to_float and imath_float_to_half (half.h), and
 * the processor's F16C.  They are here because libilf needs OpenEXR's core library alone, not Imath, and
 * because lookups, for which texels are finite, take the two operations of half_to_float instead of Imath's
 * table of 256 kB.
 */
#ifndef EXR_HALF_H
#define EXR_HALF_H

#include <math.h>
#include <stdint.h>

/* Exact, denormals included; infinity and NaN come out finite: for values that were checked for them. */
static inline float half_to_float(uint16_t h)
{
    const uint32_t sign = (uint32_t)(h & 0x8000u) << 16;
    union {
        uint32_t u;
        float f;
    } v = {.u = (uint32_t)(h & 0x7fffu) << 13};

    v.f *= 0x1p112f; /* the exponents' biases differ by 112 */
    v.u |= sign;
    return v.f;
}

/* The same for any value: infinity and NaN stay what they are. */
static inline float half_to_float_any(uint16_t h)
{
    if ((h & 0x7c00u) != 0x7c00u) return half_to_float(h);
    return h & 0x3ffu ? NAN : h & 0x8000u ? -INFINITY : INFINITY;
}

/* Rounded to nearest, ties to even; |v| <= 65504, which the caller has checked. */
static inline uint16_t half_from_float(float v)
{
    union {
        float f;
        uint32_t u;
    } x = {.f = v};
    const uint16_t sign = (uint16_t)(x.u >> 16 & 0x8000u);

    x.u &= 0x7fffffffu;
    if (x.u < 0x38800000u) { /* below 2^-14: a denormal half is a multiple of 2^-24 */
        x.f = rintf(x.f * 0x1p24f);
        return (uint16_t)(sign | (uint16_t)x.f);
    }
    const uint32_t rounded = x.u + 0x0fffu + (x.u >> 13 & 1u);
    return (uint16_t)(sign | ((rounded - 0x38000000u) >> 13));
}

#endif
