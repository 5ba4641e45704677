/*
 * frames.h - the exposures of one series as rows of codes, in step.
 *
 * The series is gone through more than once (choosing samples, merging).  Small series are
 * kept as codes in memory after the first pass; camera raw, which can't be streamed, is spooled to
 * an unlinked temporary file picture by picture; everything else is decoded again.
 *
 * Missing pixels.  An exposure may have nothing to say of a pixel: its alpha is below full (registered
 * images beyond their border), its codes are the fill colour, or it was moved and the pixel lies
 * outside.  That is neither black nor clipped, and has a mask of its own: one byte per pixel and
 * exposure, not 0 where missing.
 */
#ifndef HDRGEN_FRAMES_H
#define HDRGEN_FRAMES_H

#include <stdint.h>

#include "base/errmsg.h"
#include "image/image.h"
#include "sensor.h"
#include "vision/warp.h"

typedef struct frames frames;

typedef struct frames_facts {
    int n, width, height;
    int channels; /* 1 or 3; alpha is left out */
    int max_code;
    int raw;           /* codes are the sensor's own values less black (sensor.h) */
    const cfa *mosaic; /* of camera raw with one value per pixel, else NULL */
    int clip[3];       /* camera raw: values from here on are clipped, by colour; else max_code */
} frames_facts;

/* Open n files; all must agree in size, channels and depth.  memory: bytes of codes that may
 * be kept.  bits: how many of the files' bits the codes fill, from the lowest (0: all).  fill: NULL, or the
 * code triple that marks missing pixels.  half: the result will be at half size: camera raw with a Bayer
 * mosaic is wanted then.  Pixels lie as in the files, whatever their orientation tags say. */
int frames_open(frames **f, char *const *paths, int n, int64_t memory, int bits, const int *fill, int half,
                errmsg *e);
void frames_close(frames *f);
const frames_facts *frames_get_facts(const frames *f);
const img_info *frames_info(const frames *f, int k);
const sensor_facts *frames_sensor(const frames *f, int k); /* NULL: not camera raw */

/* Renumber before the first row is read: exposure k becomes what order[k] was. */
int frames_reorder(frames *f, const int *order, errmsg *e);

/* After reordering, before the first row: camera raw is unpacked here, and max_code and clip are known then.
 * progress may be NULL. */
int frames_begin(frames *f, void (*progress)(const char *what, double done, double total), errmsg *e);

/* Rows per strip that frames_next gives at most. */
int frames_strip_rows(const frames *f);

/* Start again from the top. */
int frames_rewind(frames *f, errmsg *e);

/* From now on exposure k is what it shows at motion_apply(m, x, y), interpolated (warp.h); pixels that lie
 * outside it, or beside one of its missing ones, are missing.  Between frames_rewind and the first strip;
 * once per exposure. */
int frames_move(frames *f, int k, const motion *m, const warp_opts *o, errmsg *e);

/* The next strip: codes[k] points at its first row in exposure k (width*channels per row), missing[k] at the
 * mask (width per row) or is NULL where the strip has all its pixels; valid until the next call.  Missing
 * pixels' codes are max_code.  Returns the number of rows, 0 at the end, -1 on failure (also: an exposure
 * that has no pixel at all). */
int frames_next(frames *f, const uint16_t **codes, const uint8_t **missing, errmsg *e);

#endif
