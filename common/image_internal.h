/*
 * image_internal.h - what image.c and the formats (image_*.c) share.
 *
 * A format is a table of functions.  open() reads the header and fills r->info; row() gives
 * the next row from the top; what a format keeps between calls hangs on r->state.  Functions
 * return 0, or -1 with words in e; close() is called once after any open(), failed or not.
 */
#ifndef IMAGE_INTERNAL_H
#define IMAGE_INTERNAL_H

#include <stdio.h>

#include "image.h"
#include "outfile.h"

enum { IMG_HEAD = 4096 }; /* bytes of a file that sniff() gets to see */

typedef struct img_codec {
    const char *format;                                /* as in img_info */
    int (*sniff)(const unsigned char *head, size_t n); /* is it this format? */
    int (*open)(img_reader *r, errmsg *e);
    int (*row)(img_reader *r, float *row, errmsg *e);
    void (*close)(img_reader *r);
} img_codec;

struct img_reader {
    img_info info;
    const img_codec *codec;
    const char *path; /* for messages; owned */
    FILE *f;          /* seekable, at its beginning when open() is called; owned */
    int64_t bytes;    /* size of the file */
    int y;            /* rows given so far */
    int failed;
    void *state;
};

extern const img_codec img_codec_exr, img_codec_hdr, img_codec_png, img_codec_jpeg, img_codec_tiff,
    img_codec_pnm, img_codec_raw;

/* Refuse sizes beyond the limits of image.h. */
int img_check_size(const char *path, int64_t width, int64_t height, errmsg *e);

/* The common end of open(): check the size, then fill the rest of r->info. */
int img_set_info(img_reader *r, int64_t width, int64_t height, int channels, double max_code, errmsg *e);

/* One line about the file that r reads: "PATH: words"; returns -1. */
int img_bad(const img_reader *r, errmsg *e, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

/* For TIFF and raw: is a TIFF one that holds camera raw data?  Leaves f where it was. */
int img_tiff_is_raw(FILE *f);

/* A picture whose stored rows aren't the shown rows from the top: it is held whole. */
typedef struct img_order {
    int columns; /* stored lines are columns */
    int flip_x;  /* from the right */
    int flip_y;  /* from the bottom */
} img_order;

/* Give a row of a held picture: read all stored lines with next() into the right places at the
 * first call.  *held is owned by the caller (free). */
int img_held_row(img_reader *r, float **held, img_order order,
                 int (*next)(img_reader *r, float *line, errmsg *e), float *row, errmsg *e);

/* Writers; each makes the whole file at o, which image.c commits.  path is for messages. */

int img_write_exr(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);
int img_write_hdr(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);
int img_write_png(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);

/* NULL, or the name of a picture format that is not read here and what converts it (image_foreign.c). */
const char *img_foreign(const unsigned char *head, size_t n);

#endif
