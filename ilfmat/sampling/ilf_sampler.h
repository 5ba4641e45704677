/*
 * ilf_sampler.h - what the sampler's files share: bright patches and slices.
 */
#ifndef ILF_SAMPLER_H
#define ILF_SAMPLER_H

#include "ilf_internal.h"

/* The map of a slice: SIDE x SIDE cells of equal solid angle over the hemisphere, numbered along a Morton
 * curve so that neighbours in number are neighbours in direction. */
enum { SLICE_BITS = 8, SLICE_SIDE = 1 << SLICE_BITS, SLICE_CELLS = SLICE_SIDE * SLICE_SIDE };
#define SLICE_OMEGA (2 * ILF_PI / SLICE_CELLS)

/* Where light may be is marked in cells of 2 x 2 of the map's: the bounds are no finer than that. */
enum { MARK_SIDE = SLICE_SIDE / 2, MARK_CELLS = MARK_SIDE * MARK_SIDE };

/* Part of the draws that goes to all directions alike, in case a patch is not where it seems. */
#define SLICE_UNIFORM 0.02

/* Part of the draws that goes where the bounds say that light may be, seen from the cube's centre or not. */
#define SLICE_BOUND 0.1

/* A probe's bright patch: some texels whose luminance exceeds the threshold, as a ball in the plane's
 * coordinates (u, v, n; origin at probe (0,0)) around the place where their light comes from. */
typedef struct patch {
    float u, v, n; /* centre */
    float radius;  /* holds all of the patch, bilinear lookup's half texel included */
    float excess;  /* largest luminance over the threshold, in units of the sampler's */
    int i, j;      /* the probe */
    int whole;     /* 0: a part of a patch that lies on two things, one behind the other */
} patch;

typedef struct patch_list {
    patch *p; /* probe after probe */
    size_t n, room;
} patch_list;

struct ilf_slice {
    int64_t key[3]; /* cube of space */
    ilf_past past;
    double total;      /* sum of the cells' excess luminance */
    int cells;         /* with light */
    int last;          /* cell drawn last */
    uint16_t *cell;    /* ascending Morton numbers */
    float *cdf;        /* cells + 1 values from 0 to 1 */
    float *near, *far; /* distances of the light in each cell */
};

struct ilf_sampler {
    const ilf *field;
    ilf_frame frame;
    ilf_sampler_spec spec;
    double threshold, cube;
    double unit; /* largest excess of all: weights relative to it stay in a float's range for any light */
    patch_list patches;
    ilf_slice **table; /* open addressing, table_size a power of two */
    size_t table_size, used;
    int64_t built;
    float (*cell_dir)[3], (*mark_dir)[3]; /* centres of cells, by row and column */
    struct mark {
        float weight, probe_weight, near, far;
        int owner; /* probe that marked it last, + 1 */
    } *mark;       /* scratch of MARK_CELLS; below, of SLICE_CELLS */
    float *weight, *near, *far, *seen, *most;
    uint16_t *marked, *touched;
};

/* List what exceeds the threshold (ilf_patches.c); threshold 0 is set to 3 times the mean. */
ilf_status ilf_find_patches(ilf_sampler *s, ilf_error *err);

/* The largest bilinear weight that a patch's probe has anywhere in the cube (or ball) of half edge r around
 * x, plane's coordinates; 0 where the patch is not seen. */
float ilf_patch_weight(const ilf_sampler *s, const patch *p, const float x[3], float r);

/* ---- numbering of cells: Morton, column's bits even, row's odd ---- */

/* Every second bit, and back. */
static inline uint32_t spread(uint32_t x)
{
    x = (x | x << 4) & 0x0f0fu;
    x = (x | x << 2) & 0x3333u;
    return (x | x << 1) & 0x5555u;
}

static inline uint32_t gather(uint32_t x)
{
    x &= 0x5555u;
    x = (x | x >> 1) & 0x3333u;
    x = (x | x >> 2) & 0x0f0fu;
    return (x | x >> 4) & 0x00ffu;
}

static inline uint16_t cell_number(int a, int b)
{
    return (uint16_t)(spread((uint32_t)a) | spread((uint32_t)b) << 1);
}

static inline int clamp_cell(double x)
{
    return x < 0 ? 0 : x >= SLICE_SIDE ? SLICE_SIDE - 1 : (int)x;
}

#endif
