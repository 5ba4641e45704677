/*
 * outline.h - the outlines of a destination picture's texels, carried into the source picture.
 *
 * Row by row: edges shared by two texels are the same points for both, which is what makes the
 * remap's partition exact.  An edge that comes out curved is refined until its chords stay
 * within OUTLINE_FLATNESS.  One outliner is for one thread.
 */
#ifndef OUTLINE_H
#define OUTLINE_H

#include "chart.h"

typedef struct outliner outliner;

outliner *outliner_new(const chart *dst, const chart *src); /* charts stay the caller's; NULL: no memory */
void outliner_free(outliner *o);

/* Make row y ready; rows in ascending order reuse the line between them.  -1: no memory. */
int outliner_row(outliner *o, int y);

/* Which way round outlines run in the source picture: 1 clockwise on the screen (y down), -1 the other. */
int outliner_sense(const outliner *o);

/* Do all four corners of texel x of the ready row lie within the source's field? */
int outliner_inside(const outliner *o, int x);

#define OUTLINE_FLATNESS 0.02 /* source pixels that a chord may be off */

/* Outline of texel x of the ready row: *n points in *xy, owned by the outliner, good until the
 * next call.  1: a closed contour; in a longitude grid x is continuous, may leave the picture, and is the
 * period whose middle is nearest to the picture's.  0: the texel lies outside the source's field.  -1: no
 * memory. */
int outliner_texel(const double **xy, int *n, outliner *o, int x);

#endif
