/*
 * rawfile.h - LibRaw, set up the same way for all that read camera raw: the developed picture (image_raw.c)
 * and the sensor's own values (hdrgen).
 */
#ifndef RAWFILE_H
#define RAWFILE_H

#include <libraw/libraw.h>

/* A handle (libraw_close) that is to be opened; NULL: out of memory.  *broken, which must live as long as it,
 * becomes 1 when data turn out to be missing or damaged: LibRaw goes on with made-up pixels. */
libraw_data_t *rawfile_new(int *broken);

/* Of the opened file.  Orientation as EXIF's 1..8; a number that may be stated, 0 where it is not. */
int rawfile_orientation(const libraw_data_t *raw);
double rawfile_stated(float v);

/* Is white level `channel` (0..3) of a linear DNG the stated one less black, although its values have the
 * black level still in them? */
int rawfile_white_lacks_black(const libraw_data_t *raw, int channel);

/* The matrix from balanced sensor values to sRGB's primaries, rows adding up to 1: 1; else 0 and the
 * identity, where it is not known or makes no sense.  coloured: the sensor has three colours. */
int rawfile_matrix(double m[3][3], const libraw_data_t *raw, int coloured);

#endif
