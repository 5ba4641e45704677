/*
 * circles.h - OpenCV's part in finding circles: smaller and softer copies, and first guesses.  Pure.
 */
#ifndef VISION_CIRCLES_H
#define VISION_CIRCLES_H

#include "base/errmsg.h"

typedef struct vision_circle {
    double x, y, r; /* pixels; (0, 0) is the picture's top-left corner, pixel centres lie at +1/2 */
} vision_circle;

/* out (ow x oh, the caller's): g (w x h) as a smaller copy, every pixel the mean over its area (cv::resize,
 * INTER_AREA). 0 < ow <= w, 0 < oh <= h.  -1: words in e. */
int vision_reduce(float *out, int ow, int oh, const float *g, int w, int h, errmsg *e);

/* g (w x h) blurred in place by a Gaussian of sd pixels; its edge goes on outside.  -1: words in e. */
int vision_soften(float *g, int w, int h, double sd, errmsg *e);

/* Guesses at circles with radii r0..r1 in g (w x h, any scale of brightness), up to `room` of them, best
 * first: Hough's transform with gradients (cv::HoughCircles, both methods) over several thresholds.  Seeds:
 * what they are worth is for the caller to judge. Returns their number, or -1 with words in e. */
int vision_circles(vision_circle *out, int room, const float *g, int w, int h, double r0, double r1,
                   errmsg *e);

#endif
