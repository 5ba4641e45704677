/*
 * turn.h - turning a merged picture as an orientation tag asks for.  Pure.
 */
#ifndef HDRGEN_TURN_H
#define HDRGEN_TURN_H

#include <stdint.h>

#include "base/errmsg.h"
#include "image/image.h"

/* orientation: 1..8 as in EXIF (where the first stored row and column lie: 1 top left, 2 top right, 3 bottom
 * right, 4 bottom left, 5 left top, 6 right top, 7 right bottom, 8 left bottom).  *sigma: as im->pix; *flags
 * and *count: a byte per pixel; all malloc'd, replaced, each may be NULL. */
int turn_picture(img *im, float **sigma, uint8_t **flags, uint8_t **count, int orientation, errmsg *e);

#endif
