/*
 * image_exr.h - what the parts of OpenEXR input and output share.
 *
 *   image_exr_check.c    is a header what its own sizes say, has the file the bytes that it promises?
 *   image_exr_file.cpp   OpenEXR's C++ library behind a C interface: headers as plain structs, rows as floats
 *   image_exr_choose.c   which part, layer and view is the picture
 *   image_exr.c          windows, alpha, colours: the codec
 *   image_exr_write.c    output (image_exr_write_dwa.c for DWA)
 */
#ifndef IMAGE_EXR_H
#define IMAGE_EXR_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { EXR_PICKED = 4, EXR_NAME = 256 };

typedef struct exr_channel {
    const char *name;
    int x_sampling, y_sampling;
} exr_channel;

/* A part's header, as far as pictures go; strings are "" where nothing is stated. */
typedef struct exr_part {
    const char *name, *view;
    int deep, complete;
    int channels;
    const exr_channel *channel;
    int nviews; /* attribute multiView of a single part: the first is the default */
    const char *const *views;
    int data[4], display[4]; /* x and y of the first, x and y of the last pixel */
    double pixel_aspect;     /* width over height */
    int envmap;              /* -1 none, 0 latitude/longitude, 1 cube */
    int has_chroma;
    double chroma[8];   /* x y of red, green, blue, white */
    int straight_alpha; /* EXR_STRAIGHT says so: colours are not multiplied by alpha */
} exr_part;

/* String attribute of value "unassociated": what img_write_exr() puts beside an alpha channel, since the
 * colours of an img are not multiplied by it, as OpenEXR has it otherwise. */
#define EXR_STRAIGHT       "ilf:alpha"
#define EXR_STRAIGHT_VALUE "unassociated"

/* A file open for reading.  Calls return 0 or -1 with the library's words in why[EXR_NAME]; none throws. */
typedef struct exr_file exr_file;
int exr_file_open(exr_file **f, int fd, int64_t bytes, char *why); /* fd stays the caller's */
void exr_file_close(exr_file *f);
int exr_file_parts(const exr_file *f);
const exr_part *exr_file_part(const exr_file *f, int k); /* owned by f */

/* What will be read: n channels of a part; or, with luma, the colours that the library makes of Y, RY and BY
 * of layer names[0] ("" for none), n = 3 or 4. */
int exr_file_pick(exr_file *f, int part, const char *const *names, int n, int luma, char *why);
int exr_file_lines(
    const exr_file *f); /* rows that are decoded together: ask for such bands, counted from data[1] */

/* Rows y0..y1 (inside the data window) of all its columns, the n channels interleaved. */
int exr_file_rows(exr_file *f, float *rows, int y0, int y1, char *why);

/* A number or string attribute of a part as text; 1 if there is one. */
int exr_file_fact(const exr_file *f, int part, const char *name, char *text, size_t room);

#ifdef __cplusplus
}
#else

#include "image_internal.h"

/* Refuse what the library would read astray, or take unreasonable memory for. */
int exr_check(const img_reader *r, errmsg *e);

typedef struct exr_choice {
    int part, n, luma; /* luma: Y, RY, BY, which the library makes three colours of */
    char name[EXR_PICKED][EXR_NAME];
    char said[2 * EXR_NAME]; /* remark, or "" */
} exr_choice;

/* Which channels are the picture; layer (may be NULL) as in img_open_opts. */
int exr_choose(exr_choice *c, const exr_file *f, const char *layer, const img_reader *r, errmsg *e);

int img_write_exr_dwa(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);
#endif

#endif
