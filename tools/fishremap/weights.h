/*
 * weights.h - overlaps of one destination row at a time; what remap.c and plan.c share.
 */
#ifndef WEIGHTS_H
#define WEIGHTS_H

#include "outline.h"
#include "overlap.h"
#include "remap.h"

typedef struct entry {
    uint32_t px;     /* source pixel */
    float w, wx, wy; /* weight and weighted offset from the pixel's centre, of sum(w) = 1 */
} entry;

typedef struct row {
    entry *e;
    size_t n, room;
    size_t *end; /* texel x owns e[end[x-1]..end[x]) */
    float *alpha;
} row;

/* What all threads share while weights are made. */
typedef struct geometry {
    const chart *dst, *src;
    const unsigned char *skip;
    float *per_area;       /* solid angle per pixel area; disc: per pixel, grid: per row */
    float *per_area_grows; /* grid: its growth per pixel downwards, per row */
    int whole;             /* the source shows every direction */
} geometry;

/* What one thread needs. */
typedef struct bench {
    outliner *lines;
    overlap *cells;
    overlap_cell *span;
    size_t span_room;
    double *rim; /* contour of the image circle, for the texel around the far pole */
    int nrim;
    double *copy; /* of a contour, a period further */
    int copy_room;
} bench;

#define BAND 8 /* rows a thread takes at a time: neighbours share a line */

int geometry_init(geometry *g, const chart *dst, const chart *src, const unsigned char *skip, errmsg *e);
void geometry_free(geometry *g);
int bench_init(bench *b, const geometry *g); /* -1: no memory; free in any case */
void bench_free(bench *b);
int row_init(row *r, int width);
void row_free(row *r);

/* All overlaps of row y.  -1: no memory. */
int row_make(row *r, bench *b, const geometry *g, int y);

#endif
