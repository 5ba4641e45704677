/*
 * picture_in.h - is a captured file whole, and how much of it clips or is black?
 */
#ifndef PICTURE_IN_H
#define PICTURE_IN_H

#include "base/errmsg.h"

/* Whole: PNG by its chunks' checksums and end, binary PNM by its size, JPEG by its end marker and decoding,
 * everything else by decoding. */
int picture_whole(const char *path, errmsg *e);

typedef struct picture_levels {
    double clip_level, black_level; /* shares of the highest code */
    double circle;                  /* radius over half the shorter side; 0 = whole picture */
} picture_levels;

/* Shares of the pixels in the circle of which some channel clips, and of which no channel is above black.
 * Refuses pictures without code numbers. */
int picture_shares(double *clip, double *black, const char *path, const picture_levels *l, errmsg *e);

#endif
