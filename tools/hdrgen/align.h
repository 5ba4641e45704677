/*
 * align.h - how the shots of one series have moved against each other.
 *
 * Neighbours in time are registered (common/vision/motion.h), the shorter one brought to the longer one's
 * brightness and both cut off at the same value, so that what one of them clips has no edge in the other; the
 * steps are chained to the shot in the middle, which stays.  Pure: no I/O.
 */
#ifndef HDRGEN_ALIGN_H
#define HDRGEN_ALIGN_H

#include "base/errmsg.h"
#include "vision/motion.h"

typedef enum align_mode {
    ALIGN_NEVER,
    ALIGN_AUTO,  /* move what is better for it; what can't be registered stays where its neighbour is */
    ALIGN_ALWAYS /* as auto, but a shot that can't be registered is an error */
} align_mode;

/* One shot as alignment sees it: width*height grey values 0..255 of a picture as people look at it (about the
 * 1/2.2th power of light), and bytes that are 0 where it has no data (NULL: it has everywhere). */
typedef struct align_picture {
    const float *grey;
    const unsigned char *seen;
} align_picture;

typedef struct align_shot {
    motion m;             /* from the middle shot's pixels to this one's */
    double before, after; /* correlation with its neighbour, without and with their motion */
    int registered;       /* 0: too little is seen in both, the neighbour's motion is taken */
    int moves; /* 0: m is too small or too uncertain to be worth an interpolation; the shot stays */
} align_shot;

/* Fill out[n] for pictures[n] of w x h pixels, from the shortest exposure to the longest. */
int align_estimate(align_shot *out, const align_picture *pictures, const double *exposure, int n, int w,
                   int h, errmsg *e);

/* Greatest displacement, in pixels, that m makes in a picture of w x h. */
double align_reach(const motion *m, int w, int h);

#endif
