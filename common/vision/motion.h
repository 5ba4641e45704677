/*
 * motion.h - how one photograph has moved against another of the same scene (OpenCV's ECC).
 *
 * Pixels as OpenCV counts them: (0, 0) is the centre of the top-left pixel, x to the right, y down.
 */
#ifndef VISION_MOTION_H
#define VISION_MOTION_H

#include "base/errmsg.h"

/* A turn and a shift: what stands at (x, y) of the picture at rest stands at
 *     x' = cos(a) x - sin(a) y + dx,   y' = sin(a) x + cos(a) y + dy
 * of the picture that has moved (a in radians, clockwise as seen). */
typedef struct motion {
    double angle, dx, dy;
} motion;

/* The motion that does b after a: first from the picture at rest to a second one, then from that to a third.
 */
motion motion_chain(motion a, motion b);

/* Where (x, y) of the picture at rest lies in the picture that has moved. */
void motion_apply(const motion *m, double x, double y, double *mx, double *my);

/* The motion in pixels of a picture that is `factor` times as large (pixel corners kept: pixel i of the small
 * one covers factor pixels of the large one). */
motion motion_scaled(motion m, double factor);

typedef struct motion_found {
    motion m;
    double before, after; /* correlation of the two without motion and with m, over pixels seen in both */
    double self;          /* of `moved` with itself displaced by m: what such a motion costs this picture */
} motion_found;

/* Find the motion of `moved` against `rest`: w x h values each, row by row, of alike brightness (0..255);
 * coarse to fine over `levels` octaves, by the enhanced correlation coefficient (Evangelidis and Psarakis
 * 2008), which gain and offset don't change.  rest_seen, seen: w x h bytes, 0 where
 * `rest` and `moved` have no data, or NULL.  Where
 * no level converges or the best is no better than none, the motion is none and after = before, self = 1.
 * Pictures without contrast correlate by 0.  -1 with words where OpenCV fails otherwise. */
int vision_motion(motion_found *out, const float *rest, const float *moved, const unsigned char *rest_seen,
                  const unsigned char *seen, int w, int h, int levels, errmsg *e);

#endif
