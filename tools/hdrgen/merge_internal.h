/*
 * merge_internal.h - the tables behind merge.h, shared by their maker and the row kernel.
 */
#ifndef HDRGEN_MERGE_INTERNAL_H
#define HDRGEN_MERGE_INTERNAL_H

#include "merge.h"

enum { GRID = 64, OCTAVES = 30, CELLS = GRID * OCTAVES }; /* cells of log2 e, from 2^-28 to 2^2 */
static const int grid_top_octave = 2;

/* What a sample of predicted exposure e is expected to say. */
typedef struct expectation {
    float weight; /* of the relative residual y/e - mean: e^2 mean'(e) / variance */
    float info;   /* weight * mean': Fisher information about ln X */
    float mean;   /* E[finv(z) | e, not clipped] / e */
    float rest;   /* bound on the information of all shorter exposures together */
    float sd;     /* standard deviation of y, relative to e */
} expectation;

typedef struct codeval {
    float y;     /* finv(z); 0 at the highest code */
    float valid; /* 1, at the highest code 0 */
    float w, wy; /* weight on its own: e^2 / variance, or hat; hat times ln y (0 for noise) */
} codeval;

typedef struct merge_channel {
    codeval *code;       /* [max_code + 1] */
    expectation *expect; /* [CELLS] */
    int top;             /* codes from here on are clipped */
    int safe;            /* codes up to this are surely not clipped */
    float clip, black;   /* exposures at the edges of the highest code and of code 0 */
    float dim;           /* no noise makes more than this of black */
} merge_channel;

struct merge {
    int n, channels, max_code;
    merge_weight weight;
    float tolerance; /* of ghost.c */
    int *order;      /* exposures from the longest to the shortest; the arrays below are in that order */
    float *rt;       /* 1 / t */
    float *lnt;      /* ln t */
    int *offset;     /* log2 t in cells */
    merge_channel ch[RESPONSE_MAX_CHANNELS];
};

/* log2 x in grid cells, as the index of the cell; to 0.01 octave by the float's own bits. */
static inline int cell_of(float x)
{
    union {
        float f;
        uint32_t u;
    } v = {x};
    int exponent = (int)(v.u >> 23) - 127;
    v.u = (v.u & 0x7fffffu) | 0x3f800000u;
    float m = v.f - 1; /* log2(1+m), cubic that is exact at both ends */
    float l = m * (1.4195f + m * (-0.5806f + m * 0.1611f));
    return (int)(((float)exponent + l) * GRID + 8192.0f) - 8192;
}

static inline int clamp_cell(int i)
{
    return i < 0 ? 0 : i >= CELLS ? CELLS - 1 : i;
}

#endif
