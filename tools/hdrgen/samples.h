/*
 * samples.h - the pixels from which response, noise and times are learnt.
 *
 * From each cell of a grid over the picture the flattest of a few seeded random places is
 * taken (low gradient: least harm from blur and misregistration; one per cell: spread).
 */
#ifndef HDRGEN_SAMPLES_H
#define HDRGEN_SAMPLES_H

#include <stddef.h>
#include <stdint.h>

#include "base/errmsg.h"
#include "cfa.h"
#include "response.h"

typedef struct samples {
    int exposures, channels, max_code;
    int n[RESPONSE_MAX_CHANNELS];
    int cap;
    int clip[RESPONSE_MAX_CHANNELS]; /* codes from here on are clipped: max_code until white.h says otherwise
                                      */
    uint16_t *z[RESPONSE_MAX_CHANNELS];   /* z[c][i*exposures + k]; max_code where clipped or missing */
    uint8_t *gone[RESPONSE_MAX_CHANNELS]; /* like z: not 0 where missing; NULL where nothing is */
    uint8_t
        *out[RESPONSE_MAX_CHANNELS]; /* [i]: contradicts itself, nothing is learnt from it (contradict.h) */
    uint32_t *at[RESPONSE_MAX_CHANNELS];   /* [i]: the pixel, y*width + x */
    float *steep[RESPONSE_MAX_CHANNELS];   /* [i]: change of the code to the neighbours, over its mean */
    int width, height, mosaic;             /* of the picture; each channel has pixels of its own */
    uint16_t *dark[RESPONSE_MAX_CHANNELS]; /* dark[c][i]: the dark frame's code there; or NULL */
} samples;

/* Room for about `wanted` pixels of a width x height picture; channels 1 or 3; mosaic: NULL, or the
 * colours of pixels that have one value each. */
typedef struct sampler {
    samples s;
    int width, height, cell, lanes; /* lanes: interleaved values per pixel in a row */
    const cfa *mosaic;              /* NULL: every pixel has all channels */
} sampler;

int sampler_init(sampler *p, int width, int height, int exposures, int channels, int max_code,
                 const cfa *mosaic, int with_dark, int wanted, errmsg *e);

/* Look at rows [y0, y0+rows); codes[k] and missing[k] (frames.h) point at row y0 of exposure k, dark at
 * that of the dark frame (NULL without). */
int sampler_strip(sampler *p, const uint16_t *const *codes, const uint8_t *const *missing,
                  const uint16_t *dark, int y0, int rows, errmsg *e);

void samples_free(samples *s);

#endif
