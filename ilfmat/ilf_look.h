/*
 * ilf_look.h - the last step of a lookup, once it is known between which four probes the ray crosses the
 * plane: angles, texels, their sum.  ilf_look.c has it in plain C, ilf_look_avx2.c four at a time.
 *
 *   k = 2  o-----o  3         probe k stands in column k & 1, row k >> 1 of the cell
 *          |  p  |
 *   k = 0  o-----o  1
 */
#ifndef ILF_LOOK_H
#define ILF_LOOK_H

#include "ilf_internal.h"

/* Lengths and directions in the plane's frame, from probe (0, 0). */
typedef struct ilf_cell {
    double w[4];                 /* weights; where one is 0, its probe is one of the others */
    const unsigned char *pix[4]; /* texels: layout as in ilf_internal.h */
    const probe *probe[4];
    double d[3];                 /* direction; a length within 1e+-100 */
    /* with depth correction only */
    double h[3];                 /* where the ray meets the geometry */
    double i, j;                 /* column and row of probe 0, of span_u and span_v */
    double len_u, len_v, cos_uv; /* edges of the sampled rectangle, cosine between them */
} ilf_cell;

/* Radiance of the cell.  ILF_NO_DEPTH: all probes in direction d; ILF_DEPTH: each towards h (d where h is its position). */
ilf_look_fn ilf_look_plain, ilf_look_plain_depth;

/* A distance to the geometry whose square is far from over- and underflow; others are left to plain C. */
static inline int ilf_usual_size(double x)
{
    return x > 1e-100 && x < 1e100;
}

/* The faster one where the processor has it (AVX2, FMA, F16C), else NULL.  Needs distances of usual size. */
ilf_look_fn *ilf_look_avx2(const ilf *field, ilf_mode mode);

#endif
