/*
 * residuals.h - one channel's samples against the current model: what calibrate.c learns from.
 */
#ifndef HDRGEN_RESIDUALS_H
#define HDRGEN_RESIDUALS_H

#include "noise.h"
#include "response.h"
#include "samples.h"

enum { BINS = 320 }; /* of ln X */

/* Relative residuals rho = y / (X t) - 1 of one bin and exposure. */
typedef struct cellsum {
    double n, rho, sq, sq_n; /* number, sum, sum of squares / (1 - leverage) and their number */
} cellsum;

typedef struct channel {
    const samples *s;
    int c, n, kk;                /* which channel, its pixels, exposures */
    double lx0, bins_per_ln;     /* bin = (ln X - lx0) * bins_per_ln */
    float *x;                    /* [n] current X, 0: no usable sample */
    float *w;                    /* [BINS * kk] 1 / relative variance, 0 inactive */
    float *shift;                /* [BINS * kk] mean of rho: what clipping at black adds */
    float *limit;                /* [BINS * kk] beyond which a residual is an outlier */
    int first[BINS], last[BINS]; /* active exposures of a bin lie in [first, last) */
    float *rt;                   /* 1 / t_k */
    float *y;                    /* finv as float */
    cellsum *cell;               /* [BINS * kk] */
    float *code_w; /* [max_code + 1] working space of channel_first_x, so that only channel_alloc can fail */
    double *scatter;    /* [2 * BINS * kk] of channel_fit_model_error */
    double model_error; /* mean square of what noise does not explain in the bins' means */
    double slack;       /* variances are multiplied by this while far from the solution */
} channel;

int channel_alloc(channel *h, const samples *s, int c); /* -1: out of memory; free it all the same */
void channel_free(channel *h);

/* X at the middle of a bin. */
double bin_x(const channel *h, int b);

/* Tables for the current response, noise and ln t. */
void channel_prepare(channel *h, const response *r, const noise_model *m, const double *lnt);

/* First X, from weights of the samples themselves. */
void channel_first_x(channel *h, const response *r, const noise_model *m);

/* X of every pixel, and the residuals by bin and exposure. */
void channel_gather(channel *h);

/* Noise model from the residuals' scatter; parameters of fixed that are >= 0 are kept.  damped: go half way.
 * -1: out of memory. */
int channel_fit_noise(noise_model *m, const channel *h, const response *r, const double *lnt,
                      const noise_model *fixed, int damped);

/* h->model_error from the bins' means. */
void channel_fit_model_error(channel *h);

/* Mean squared residual over its variance; pixels that take part. */
double channel_chi2(const channel *h);
int channel_pixels(const channel *h);

#endif
