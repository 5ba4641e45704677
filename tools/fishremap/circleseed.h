/*
 * circleseed.h - first guesses at circles in a picture.  Pure.
 *
 * Three sources, so that what one overlooks another has: every circle on the smallest copy (large ones,
 * partly hidden or out of the picture); votes of the edges for the centres that their gradients point to
 * (small ones); OpenCV's circle detectors.
 */
#ifndef CIRCLESEED_H
#define CIRCLESEED_H

#include "rim.h"

typedef struct circle_seed {
    double c[3]; /* x, y, radius; pixels of level `at` */
    int at;
    double score; /* rim_score there */
    int placed;   /* a guess from the frame: climbed from on fine levels alone, as coarse ones show nothing so
                     near to the edge */
} circle_seed;

/* Up to `room` seeds, all on one level of middling size, where they are at the top of rim_score's hills, best
 * first; radii r0..r1 (alike: a known radius), pixels of level 0.  Returns how many, -1 with words in e. */
int circle_seeds(circle_seed *s, int room, const rim_pyramid *p, circle_kind kind, double r0, double r1,
                 errmsg *e);

#endif
