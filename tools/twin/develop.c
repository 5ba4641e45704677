/*
 * develop.c - the model of develop.h.
 *
 * Poisson numbers: product of uniforms below a mean of 12; above it the transformed rejection with
 * squeeze of W. Hoermann, "The transformed rejection method for generating Poisson random
 * variables" (1993), algorithm PTRS: exact for every mean.
 */
#include "develop.h"

#include <math.h>
#include <string.h>

double curve3_at(const curve3 *c, int channel, double x)
{
    int lo = 0, hi = c->n - 1;
    if (!(x > c->x[0])) return c->y[0][channel];
    if (x >= c->x[hi]) return c->y[hi][channel];
    while (hi - lo > 1) {
        int mid = (lo + hi) / 2;
        if (c->x[mid] <= x) lo = mid;
        else hi = mid;
    }
    double t = (x - c->x[lo]) / (c->x[hi] - c->x[lo]);
    return (1 - t) * c->y[lo][channel] + t * c->y[hi][channel];
}

double curve3_inverse(const curve3 *c, int channel, double y)
{
    int lo = 0, hi = c->n - 1;
    if (!(y > c->y[0][channel])) return c->x[0];
    if (y >= c->y[hi][channel]) return c->x[hi];
    while (hi - lo > 1) {
        int mid = (lo + hi) / 2;
        if (c->y[mid][channel] <= y) lo = mid;
        else hi = mid;
    }
    double t = (y - c->y[lo][channel]) / (c->y[hi][channel] - c->y[lo][channel]);
    return (1 - t) * c->x[lo] + t * c->x[hi];
}

static uint64_t mix(uint64_t x)
{
    /* finaliser of splitmix64 */
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

double rng_uniform(counter_rng *r)
{
    uint64_t h = mix(r->key ^ mix(r->n++));
    return ((double)(h >> 12) + 0.5) * 0x1p-52; /* never 0 nor 1 */
}

double rng_normal(counter_rng *r)
{
    double a = rng_uniform(r), b = rng_uniform(r);
    return sqrt(-2 * log(a)) * cos(2 * M_PI * b);
}

double rng_poisson(counter_rng *r, double mean)
{
    if (!(mean > 0)) return 0;
    if (mean < 12) {
        double limit = exp(-mean), product = rng_uniform(r);
        int k = 0;
        while (product > limit) {
            product *= rng_uniform(r);
            k++;
        }
        return k;
    }
    double root = sqrt(mean), b = 0.931 + 2.53 * root, a = -0.059 + 0.02483 * b;
    double inv_alpha = 1.1239 + 1.1328 / (b - 3.4), vr = 0.9277 - 3.6224 / (b - 2);
    for (;;) {
        double u = rng_uniform(r) - 0.5, v = rng_uniform(r), us = 0.5 - fabs(u);
        double k = floor((2 * a / us + b) * u + mean + 0.43);
        int sign;
        if (us >= 0.07 && v <= vr) return k;
        if (k < 0 || (us < 0.013 && v > us)) continue;
        if (log(v) + log(inv_alpha) - log(a / (us * us) + b) <= k * log(mean) - mean - lgamma_r(k + 1, &sign))
            return k;
    }
}

double develop_response(const development *d, int channel, double x)
{
    switch (d->response) {
    case RESPONSE_SRGB: return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
    case RESPONSE_GAMMA: return pow(x, 1 / d->gamma);
    case RESPONSE_TABLE: return curve3_inverse(d->table, channel, x);
    case RESPONSE_LINEAR: break;
    }
    return x;
}

uint64_t develop_seed(uint64_t user, const double pos[3], double seconds)
{
    double v[4] = {pos[0], pos[1], pos[2], seconds};
    uint64_t h = mix(user), bits;
    for (int i = 0; i < 4; i++) {
        v[i] += 0.0; /* -0 counts as 0 */
        memcpy(&bits, &v[i], sizeof bits);
        h = mix(h ^ bits);
    }
    return h;
}

void develop(uint16_t *code, const float *radiance, const fisheye *f, const development *d, double seconds)
{
    int n = f->size;
    double max_code = (double)((1u << d->bits) - 1), gain = seconds / d->full_scale;
#pragma omp parallel for schedule(static)
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            size_t at = ((size_t)y * (size_t)n + (size_t)x) * 3;
            /* a pixel whose centre lies just outside the circle takes the edge's falloff */
            double half = n / 2.0, rho = fmin(1, hypot(x + 0.5 - half, y + 0.5 - half) / half);
            double degrees = fisheye_theta(f, rho) * 180 / M_PI;
            for (int c = 0; c < 3; c++) {
                double h = (double)radiance[at + (size_t)c] * gain;
                if (d->falloff) h *= curve3_at(d->falloff, c, degrees);
                if (d->noise) {
                    /* Far beyond saturation the noise can't show, and a count must stay finite. */
                    counter_rng r = {d->seed, (at + (size_t)c) << 16};
                    double mean = fmin(h, 1e3) * d->full_well;
                    h = (rng_poisson(&r, mean) + d->read_noise * rng_normal(&r)) / d->full_well;
                }
                h = fmin(1, fmax(0, h));
                code[at + (size_t)c] = (uint16_t)floor(max_code * develop_response(d, c, h) + 0.5);
            }
        }
}
