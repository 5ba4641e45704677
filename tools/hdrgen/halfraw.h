/*
 * halfraw.h - camera raw at half size: each 2x2 of the sensor is one RGB pixel, nothing is interpolated.
 */
#ifndef HDRGEN_HALFRAW_H
#define HDRGEN_HALFRAW_H

#include <stdint.h>

#include "errmsg.h"

/* Size of what halfraw_read will give. */
int halfraw_size(int *width, int *height, const char *path, errmsg *e);

/* Linear RGB codes 0..65535, black subtracted, camera's white balance, as common/image.h gives them at full
 * size.  *rgb is malloc'd, width*height*3; the size must be as said. */
int halfraw_read(uint16_t **rgb, int width, int height, const char *path, errmsg *e);

#endif
