/*
 * slope.h - a picture made ready for the conservative remap: the plane inside each pixel.
 *
 * The slope along x is the central difference where the picture is smooth, limited so that the plane
 * stays between the neighbours' values (monotonised central limiter, van Leer 1977), and steepened to that
 * limit where a pixel is a cut edge between two flat sides; likewise y.  The pixel's mean
 * is untouched and radiance stays >= 0.
 */
#ifndef SLOPE_H
#define SLOPE_H

#include "chart.h"
#include "remap.h"

/* pix: width*height*channels, 1 (grey), 2 (grey, alpha), 3 or 4 (RGB, alpha); alpha < 1/2, NaN
 * and infinite pixels are marked bad and take no part; so are those where mask (may be NULL) is
 * non-zero.  Pixels that the rim of a disc cuts mix with what lies outside and take the value
 * of the next pixel inwards.  -1: no memory (s untouched). */
int source_prepare(remap_source *s, const float *pix, int width, int height, int channels,
                   const unsigned char *mask, const chart *src, errmsg *e);
void source_free(remap_source *s);

#endif
