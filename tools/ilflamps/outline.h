/*
 * outline.h - the edge of what stands on a sheet, drawn sharp from the pictures.
 *
 * It begins as the line M = 1/2 of a mask.  Each probe's picture across the line, from the dark side to the
 * clear one, says where the edge really is (the middle of the step, whatever the blur); over all probes, the
 * steps' places say how far each point of the line is off and how much too high or oblique the sheet was
 * taken: a point X of a sheet at height h that is d too low seems moved by
 * -(X - p) d/h to a probe at p.
 */
#ifndef OUTLINE_H
#define OUTLINE_H

#include "sheetgrid.h"

typedef struct outline {
    int n;
    double (*at)[2], (*normal)[2]; /* towards the clear side */
    int (*beside)[2];              /* neighbours on the line, -1: none */
    double *weight;                /* how sure the pictures are */
    double plane[3];
    double scatter; /* rms of what the pictures say about a point, over a texel's width there */
    double sure;    /* part of the line that the pictures see */
} outline;

/* What one picture says about a point of the line. */
typedef struct saying {
    int point, probe;
    double off;      /* the edge's place along the normal */
    double lean[3];  /* d off / d (height, slopes) */
    double w, width; /* weight; a texel's width there, scene's unit */
} saying;

/* What pictures of probes not in `fold` say about all points.  *all is the caller's to free.  Returns their
 * number, or -1. */
int outline_listen(saying **all, const outline *o, const lightfield *f, int fold);

/* The line M = 1/2; 1 if there is none. */
int outline_trace(outline *o, const double *M, const sheetgrid *g);
void outline_free(outline *o);

/* One round of moving it (and the sheet, if `moves`: 1 height, 3 height and slopes) by the pictures of probes
 * not in `fold`. */
int outline_settle(outline *o, const lightfield *f, int fold, int moves);

/* As a layer's picture: signed distance over softness. */
int outline_mask(ilf_mask *m, const outline *o, const sheetgrid *g);

#endif
