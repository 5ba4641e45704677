/*
 * irradiance.c - light on the plane itself, from above.
 */
#include "irradiance.h"

#include <math.h>

#include "ilflamps/lamp.h"

enum { SIDE = 8 }; /* of the square of strata that a lamp is sampled by */
static const double pi = 3.14159265358979323846;

/* Cosine times solid angle between two polar angles, all around, above the horizon. */
static double ring(double lo, double hi)
{
    const double a = sin(fmin(lo, pi / 2)), b = sin(fmin(hi, pi / 2));

    return pi * (b * b - a * a);
}

void irradiance_probe(double rgb[3], const lightfield *f, int k)
{
    const double limit = fmin(f->info.polar_valid, f->polar_max);

    rgb[0] = rgb[1] = rgb[2] = 0;
    /* rows go on to the horizon: beyond what is valid the value at its edge holds */
    for (int y = 0; y * f->dp < pi / 2; y++) {
        const int line = (int)fmin((y + .5), limit / f->dp - 1e-6);
        const double w = ring(y * f->dp, (y + 1) * f->dp) / f->nt;
        for (int x = 0; x < f->nt; x++)
            for (int c = 0; c < 3; c++)
                rgb[c] += w * (double)lf_texel(f, k, x, line < f->np ? line : f->np - 1)[c];
    }
}

/* The field's own radiance at a point of the plane: nearest probe, nearest texel. */
static const float *behind(const lightfield *f, const double o[3], const double d[3])
{
    const int i = f->nu > 1 ? (int)(o[0] / f->len_u * (f->nu - 1) + .5) : 0;
    const int j = f->nv > 1 ? (int)(o[1] / f->len_v * (f->nv - 1) + .5) : 0;
    double x, y;

    lf_place(&x, &y, f, LF_FIELD, d);
    return lf_texel(f, j * f->nu + i, (int)fmin(fmax(x, 0), f->nt - 1), (int)fmin(fmax(y, 0), f->np - 1));
}

/* Is lamp k the first that the ray meets? */
static int first(const ilf_luminaire *lamps, int n, int k, const double o[3], const double d[3])
{
    double t, other;

    if (!ilf_luminaire_hit(&t, &lamps[k], o, d)) return 0;
    for (int i = 0; i < n; i++)
        if (i != k && !lamp_is_out(&lamps[i]) && ilf_luminaire_hit(&other, &lamps[i], o, d) &&
            (other < t || (other == t && i < k)))
            return 0;
    return 1;
}

static void add_lamp(double sum[3], const lightfield *f, const ilf_luminaire *lamps, int n, int k,
                     const double o[3])
{
    for (int s = 0; s < SIDE * SIDE; s++) {
        double d[3];
        const double pdf =
            ilf_luminaire_sample(d, &lamps[k], o, (s % SIDE + .5) / SIDE, ((double)(s / SIDE) + .5) / SIDE);
        if (!(pdf > 0) || d[2] <= 0 || !first(lamps, n, k, o, d)) continue;
        const double pass = ilf_luminaire_pass(&lamps[k], o, d), w = d[2] / pdf / (SIDE * SIDE);
        const float *rest = behind(f, o, d);
        for (int c = 0; c < 3; c++)
            sum[c] += w * (pass * (double)lamps[k].rgb[c] - fmin(pass, 1) * (double)rest[c]);
    }
}

void irradiance_lamps(float *rgb, int nx, int ny, const lightfield *f, const ilf_luminaire *lamps, int n)
{
#pragma omp parallel for schedule(dynamic)
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++) {
            const double o[3] = {f->len_u * (nx > 1 ? (double)i / (nx - 1) : .5),
                                 f->len_v * (ny > 1 ? (double)j / (ny - 1) : .5), 0};
            double sum[3] = {0, 0, 0};
            for (int k = 0; k < n; k++)
                if (!lamp_is_out(&lamps[k])) add_lamp(sum, f, lamps, n, k, o);
            for (int c = 0; c < 3; c++)
                rgb[((size_t)j * (size_t)nx + (size_t)i) * 3 + (size_t)c] = (float)sum[c];
        }
}
