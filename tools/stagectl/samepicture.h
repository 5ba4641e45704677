/*
 * samepicture.h - how far two pictures are from being the same (pure).
 *
 * Both are made grey and small (box means, longer side at most 256 pixels), orientation tags left aside. With
 * rho their correlation over the image circle (Pearson), what one cannot say of the other by a gain and an
 * offset - a lamp's drift, another black level - is sqrt(1 - rho^2) of its contrast: 0 for the same picture,
 * 1 for two that have nothing in common.  The displacement that explains most of it is Lucas and Kanade's:
 * the least squares solution of b - a = -d . grad a ("An iterative image registration technique", 1981), one
 * step.
 */
#ifndef SAMEPICTURE_H
#define SAMEPICTURE_H

#include "base/errmsg.h"

typedef struct picture_difference {
    double share;    /* of the contrast, 0..1 */
    double shift[2]; /* of b against a, pixels of the pictures as they are; right, down */
} picture_difference;

/* circle: radius over half the shorter side, 0 = whole picture.  Refuses pictures of different sizes and flat
 * ones. */
int picture_differ(picture_difference *d, const char *a, const char *b, double circle, errmsg *e);

/* Standard deviation of its grey values in the circle: which exposure says most. */
int picture_contrast(double *deviation, const char *path, double circle, errmsg *e);

#endif
