/*
 * picture_out.h - code numbers to PNG (8 or 16 bit) or PPM (any depth to 16 bit), atomically.
 */
#ifndef PICTURE_OUT_H
#define PICTURE_OUT_H

#include <stdint.h>

#include "base/errmsg.h"

typedef struct picture {
    const uint16_t *code; /* width*height*3, row-major, top row first, 0..2^bits-1 */
    int width, height, bits;
    const char *comment; /* one line: how it was made */
} picture;

/* The ending of path picks the format.  PNG has no 10-bit samples: codes are stretched over 16 bits and the
 * true depth stands in the sBIT chunk, as the PNG specification (section 12.5) asks. */
int picture_write(const picture *p, const char *path, errmsg *e);

/* "png", "ppm" or NULL. */
const char *picture_format(const char *path);

#endif
