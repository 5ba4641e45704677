/*
 * landmarks.h - places of the surroundings that several pictures show: points of walls, whose luminance the
 * pictures should agree on, and creases, where one wall ends at another and the luminance steps.
 *
 * They come from an octree, or lie on a box that is not known well: its six numbers (x0 x1 y0 y1, height,
 * turn about the vertical through the plane's middle) may move, and landmarks say how they move with them.
 */
#ifndef LANDMARKS_H
#define LANDMARKS_H

#include "ilflamps/surroundings.h"

enum { BOX = 6 };

typedef struct landmark {
    double x[3];         /* field's coordinates */
    double along[3];     /* of a crease: its direction, unit; of a point: 0 */
    double lean[BOX][3]; /* how it moves with the box' numbers */
} landmark;

typedef struct landmarks {
    landmark *m;
    int n, creases; /* all; creases come last */
    int movable;    /* numbers that may move: BOX, or 0 (octree) */
    double box[BOX];
    double middle[3]; /* of the plane */
} landmarks;

/* From an octree, as seen from the middle of the plane. */
int landmarks_trace(landmarks *l, const char *octree, const lightfield *f, errmsg *e);

/* On the box that was estimated (surroundings_guess). */
int landmarks_box(landmarks *l, const surroundings *s, const lightfield *f, errmsg *e);

/* Move the box by d, and its landmarks with it. */
void landmarks_move(landmarks *l, const double d[BOX]);

void landmarks_free(landmarks *l);

#endif
