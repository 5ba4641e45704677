/*
 * response.h - what a camera's code numbers mean.
 *
 * z = f(e): e is the exposure E*t relative to the one that just reaches the highest code.
 * A response is its inverse as a table, e = finv(z), per channel, strictly increasing.
 */
#ifndef HDRGEN_RESPONSE_H
#define HDRGEN_RESPONSE_H

#include "base/errmsg.h"

enum { RESPONSE_MAX_CHANNELS = 3 };

typedef struct response {
    int channels;                    /* 1 or 3 */
    int max_code;                    /* highest code; tables have max_code + 1 entries */
    int clip[RESPONSE_MAX_CHANNELS]; /* codes from here on are clipped: max_code, or where the series' white
                                        lies */
    double *finv[RESPONSE_MAX_CHANNELS]; /* owned; finv[c][0] = 0 */
    char origin[64];                     /* how it was come by, for the picture's header */
} response;

/* Zeroed tables.  0, or -1 with words in e. */
int response_alloc(response *r, int channels, int max_code, errmsg *e);
void response_free(response *r);

/* Curves by formula; normalised so that finv(max_code) = 1. */
int response_linear(response *r, int channels, int max_code, errmsg *e);
int response_srgb(response *r, int channels, int max_code, errmsg *e);            /* IEC 61966-2-1 */
int response_gamma(response *r, int channels, int max_code, double g, errmsg *e); /* e = z^g */

/* Make channel c strictly increasing: pool adjacent violators in ln finv (isotonic regression, R's isoreg and
 * scikit-learn's IsotonicRegression; no C library that we have), then a least rise per code.  Returns the
 * number of codes that were changed, -1 if the table is not positive and finite above code 0, -2 when out of
 * memory. */
int response_make_monotone(response *r, int c);

/* Scale all channels so that the gauge holds: the hat-weighted mean over the codes of ln finv
 * is the same in each channel (equal codes are grey), and finv of what is clipped is 1 on average (of
 * logarithms).  -1 if the channels' curves are so different that this makes no sense. */
int response_normalise(response *r);

/* The end of a recovery: normalise what was got and give it to r with its origin; -1 in words, and got freed,
 * where it makes no sense. */
int response_recovered(response *r, response *got, const char *origin, errmsg *e);

/* The highest of the channels' clipped codes. */
int response_top(const response *r);

/* Exposure at which the code changes from z-1 to z (z = 1..max_code): finv(z - 1/2). */
double response_edge(const response *r, int c, int z);

/* d finv / dz at code z by differences of neighbours. */
double response_slope(const response *r, int c, int z);

/* Code, as a real number, that exposure e gives (0..max_code). */
double response_forward(const response *r, int c, double e);

/* Our own text format, and the polynomial .rsp ("order a_order ... a_0" per channel, e =
 * sum a_k (z/max)^k).  The file is recognised by its content. */
int response_load(response *r, const char *path, int channels, int max_code, errmsg *e);
int response_save(const response *r, const char *path, errmsg *e);

#endif
