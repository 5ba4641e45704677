/*
 * slope.h - a picture made ready for the conservative remap: the plane inside each pixel.
 *
 * The slope along x is the central difference where the picture is smooth, limited so that the plane
 * stays between the neighbours' values (monotonised central limiter, van Leer 1977); likewise y.  The
 * pixel's mean is untouched and radiance stays >= 0.
 */
#ifndef SLOPE_H
#define SLOPE_H

#include "chart.h"
#include "remap.h"

/* pix: width*height*4, R G B alpha, 16-byte aligned (malloc's are); it is used up: pixels that are NaN, infinite
 * or have alpha < 1/2 are marked bad, blackened and take no part.  Pixels that the rim of a disc cuts
 * mix with what lies outside and take the value of the next pixel inwards.  -1: no memory. */
int source_prepare(remap_source *s, float *pix, int width, int height, const chart *src, errmsg *e);
void source_free(remap_source *s);

#endif
