/*
 * ilf_round.c - numbers with fewer bits, each within a stated share of what it was.
 *
 * A number of [2^e, 2^(e+1)) becomes the nearest multiple of 2^(e-m), ties to the even one: off by at most 2^-(m+1) of
 * itself, up as often as down.  m is the smallest that keeps that below the tolerance.  The lower bits, which
 * are noise to a compressor, are 0 then; that is all: the numbers are halves and floats as any others.
 *
 *     zero, NaN, infinity             stay what they are
 *     where the type's own steps are  the type's rounding alone (a half's multiples of 2^-24 below 2^-14): nothing
 *     coarser than 2^(e-m)            becomes 0 that would not have without
 *     what would become infinite      stays what it is
 *     below 0                         as above 0
 */
#include "ilf_internal.h"

/* Of numbers of a type: bits after the leading one, exponents of the smallest normal number and of the smallest step, the
 * largest number. */
static const struct limits {
    int bits, normal, step;
    float most;
} limits_of[] = {[ILF_HALF] = {10, -14, -24, 65504.f}, [ILF_FLOAT] = {23, -126, -149, 0x1.fffffep127f}};

/* The m above. */
static int bits_kept(double tolerance, const struct limits *l)
{
    int m = 0;

    while (m < l->bits && ldexp(1, -(m + 1)) > tolerance) m++;
    return m;
}

/* Any finite number but 0, in double precision: for the few below the smallest normal one. */
static float nearest(float v, int m, int step)
{
    int e;

    (void)frexp((double)v, &e); /* |v| in [2^(e-1), 2^e) */
    const int q = e - 1 - m > step ? e - 1 - m : step;
    return (float)ldexp(rint(ldexp((double)v, -q)), q);
}

void ilf_round(float *values, size_t n, ilf_type type, double tolerance)
{
    const struct limits *l = &limits_of[type];
    const int m = bits_kept(tolerance, l), cut = 23 - m;
    const float least = ldexpf(1, l->normal);

    if (!(tolerance > 0) || cut == 0) return;
    const uint32_t below = ((uint32_t)1 << cut) - 1, half = below >> 1;
    for (size_t k = 0; k < n; k++) {
        const float v = values[k];
        uint32_t u;

        if (v == 0 || !isfinite(v)) continue;
        if (fabsf(v) < least) {
            values[k] = nearest(v, m, l->step);
            continue;
        }
        memcpy(&u, &v, sizeof u);
        u = (u + half + (u >> cut & 1)) & ~below; /* a carry goes into the exponent, as it should */
        float r;
        memcpy(&r, &u, sizeof r);
        if (fabsf(r) <= l->most) values[k] = r;
    }
}
