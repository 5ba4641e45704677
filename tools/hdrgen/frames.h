/*
 * frames.h - the exposures of one series as rows of codes, in step.
 *
 * The series is gone through more than once (choosing samples, merging).  Small series are
 * kept as codes in memory after the first pass; camera raw, which can't be streamed, is spooled to
 * an unlinked temporary file picture by picture; everything else is decoded again.
 */
#ifndef HDRGEN_FRAMES_H
#define HDRGEN_FRAMES_H

#include <stdint.h>

#include "errmsg.h"
#include "image.h"

typedef struct frames frames;

typedef struct frames_facts {
    int n, width, height;
    int channels; /* 1 or 3; alpha is left out */
    int max_code;
    int raw;      /* linear codes from camera raw */
} frames_facts;

/* Open n files; all must agree in size, channels and depth.  memory: bytes of codes that may
 * be kept.  bits: how many of the files' bits the codes fill, from the lowest (0: all).  fill: NULL, or the code triple that marks missing pixels (they become max_code).  half: camera
 * raw at half size; other formats are refused then. */
int frames_open(frames **f, char *const *paths, int n, int64_t memory, int bits, const int *fill, int half, errmsg *e);
void frames_close(frames *f);
const frames_facts *frames_get_facts(const frames *f);
const img_info *frames_info(const frames *f, int k);

/* Renumber before the first row is read: exposure k becomes what order[k] was. */
int frames_reorder(frames *f, const int *order, errmsg *e);

/* Rows per strip that frames_next gives at most. */
int frames_strip_rows(const frames *f);

/* Start again from the top. */
int frames_rewind(frames *f, errmsg *e);

/* The next strip: codes[k] points at its first row in exposure k (width*channels per row),
 * valid until the next call.  Returns the number of rows, 0 at the end, -1 on failure. */
int frames_next(frames *f, const uint16_t **codes, errmsg *e);

#endif
