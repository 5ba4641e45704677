/*
 * merge.h - exposures to radiance, one row of one channel at a time.
 *
 * Pure: no I/O, no threads, no state but the tables.  Rows may be merged in any order and by
 * any number of threads; each pixel's result depends on its own samples alone.
 */
#ifndef HDRGEN_MERGE_H
#define HDRGEN_MERGE_H

#include <stddef.h>
#include <stdint.h>

#include "base/errmsg.h"
#include "noise.h"
#include "response.h"

typedef enum merge_weight { MERGE_NOISE, MERGE_DEBEVEC } merge_weight;

enum merge_flag {
    MERGE_CLIPPED = 1, /* at the highest code in every exposure: radiance is a lower bound */
    MERGE_BLACK = 2,   /* at code 0 in every exposure: radiance is an upper bound */
    MERGE_GAP = 4,     /* clipped in some, black in the others: radiance is between the bounds */
    MERGE_GHOST = 8,   /* exposures that contradict the others were left out */
    MERGE_MISSING = 16 /* missing in every exposure: radiance is 0 and means nothing */
};

enum { MERGE_MOST = 1024 }; /* exposures */

typedef struct merge merge;

/* Tables for all channels.  exposure[k] > 0: t_k (seconds, ISO and aperture included).
 * lifted: rows come with a pedestal, so that black is not clipped at code 0. */
merge *merge_new(const response *r, const noise_model *noise, const double *exposure, int n,
                 merge_weight weight, int lifted, errmsg *e);
void merge_free(merge *m);

/* Where one row's samples lie and where its results go; strides in elements. */
typedef struct merge_row {
    const uint16_t *const *codes; /* [n] first sample of the row in each exposure */
    size_t stride;                /* from one pixel to the next in codes and pedestal */
    const uint8_t *const
        *missing; /* [n] masks, not 0: that exposure says nothing there; or NULL, any or all */
    size_t missing_stride;
    const float *pedestal;  /* exposure to subtract (dark frame), or NULL */
    int count;              /* pixels */
    float *radiance;        /* exposure / t */
    float *sigma;           /* standard deviation of radiance, or NULL */
    uint8_t *used;          /* exposures that had a say, or NULL */
    uint8_t *flags;         /* merge_flag bits, or NULL */
    size_t out_stride;      /* of radiance and sigma; used and flags are packed */
    const uint64_t *reject; /* [count], bit k: leave exposure k out; or NULL */
} merge_row;

void merge_do_row(const merge *m, int channel, const merge_row *row);

/* Deghosting, first step: OR into reject[i] the exposures (k < 64) whose sample contradicts what
 * most of the others say about that pixel and channel. */
void merge_find_ghosts(const merge *m, int channel, const merge_row *row, uint64_t *reject);

/* Relative difference that is no contradiction in this series: registration, flicker, errors of the
 * response. */
void merge_set_tolerance(merge *m, double relative);

/* Second step for a mosaic: a pixel's neighbours in the row lose the same exposures, since ghosts have
 * soft edges; no pixel loses its last usable exposure. */
void merge_settle_ghosts(const merge *m, uint64_t *reject, uint64_t *scratch, int count);

/* Second step otherwise, when all channels have been looked at, for `rows` whole rows: what moves covers
 * areas, and has soft edges; edges that are a pixel off do not.  Votes that fill no 5x5 square are
 * dropped, the others spread by 3 pixels. votes, room: [rows * width], overwritten; the result is in
 * votes. */
void merge_gather_ghosts(const merge *m, uint64_t *votes, uint64_t *room, int width, int rows);

#endif
