/*
 * warp.h - a photograph's codes where the picture at rest has them (OpenCV's warpAffine).
 */
#ifndef VISION_WARP_H
#define VISION_WARP_H

#include <stdint.h>

#include "base/errmsg.h"
#include "motion.h"

typedef struct warp_opts {
    int width, height, channels; /* channels interleaved */
    int mosaic;  /* 1: one channel, each place of a 2x2 cell a colour of its own, never mixed */
    int linear;  /* codes are proportional to light; else to about its square root */
    int clip[4]; /* codes from here on are clipped: per channel, or per place of the cell, row by row */
} warp_opts;

/* out[y][x] = in at motion_apply(m, x, y), interpolated in light, so that a lamp keeps its energy;
 * width*height*channels codes each.  What a clipped code has a part in is clipped: it becomes clip, channel
 * by channel.  seen[y*width + x] becomes 1, or 0 where the photograph ends: the codes there mean nothing. */
int vision_warp(uint16_t *out, uint8_t *seen, const uint16_t *in, const motion *m, const warp_opts *o,
                errmsg *e);

#endif
