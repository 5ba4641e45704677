/*
 * develop.h - from radiance on the sensor to the code numbers of one exposure.
 *
 *   H = L V(theta) t / R           relative exposure; R = radiance that saturates in 1 s
 *   q ~ Poisson(F H) + E Normal    electrons; F = full well, E = read noise
 *   code = round(M f(clip(q / F))) f = response curve with f(0) = 0, f(1) = 1, M = 2^bits - 1
 *
 * No I/O, no state: the same seed, node, exposure and pixel give the same noise whatever the order.
 */
#ifndef DEVELOP_H
#define DEVELOP_H

#include <stdint.h>

#include "stagectl/fisheye.h"

/* A curve per channel through n points, straight between them, constant beyond. */
typedef struct curve3 {
    int n;
    double *x;      /* n, rising; owned */
    double (*y)[3]; /* n; owned */
} curve3;

double curve3_at(const curve3 *c, int channel, double x);
double curve3_inverse(const curve3 *c, int channel, double y); /* y must rise with x */

typedef enum response_kind { RESPONSE_LINEAR, RESPONSE_SRGB, RESPONSE_GAMMA, RESPONSE_TABLE } response_kind;

typedef struct development {
    const curve3 *falloff; /* relative brightness against degrees from the axis; NULL = none */
    response_kind response;
    double gamma;        /* RESPONSE_GAMMA: f(x) = x^(1/gamma) */
    const curve3 *table; /* RESPONSE_TABLE: relative exposure against code, 0..1 */
    double full_scale;   /* R, W/(sr m2) s: radiance x time that just saturates */
    double full_well;    /* F, electrons */
    double read_noise;   /* E, electrons rms */
    int noise;           /* 0: no photon and read noise */
    int bits;            /* 1..16 */
    uint64_t seed;       /* with node and exposure */
} development;

/* Response curve, x and result in 0..1. */
double develop_response(const development *d, int channel, double x);

/* One seed from the user's seed, the place and the exposure time. */
uint64_t develop_seed(uint64_t user, const double pos[3], double seconds);

/* code: size*size*3, out.  radiance: likewise, row-major, top row first, W/(sr m2), finite, >= 0. */
void develop(uint16_t *code, const float *radiance, const fisheye *f, const development *d, double seconds);

/* Random numbers by counter: hash of (seed, n) as a number in (0, 1), and draws made of it. */
typedef struct counter_rng {
    uint64_t key, n;
} counter_rng;
double rng_uniform(counter_rng *r);
double rng_normal(counter_rng *r);
double rng_poisson(counter_rng *r, double mean);

#endif
