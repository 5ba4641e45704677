/*
 * image_internal.h - what image.c and the formats (image_*.c) share.
 *
 * A format is a table of functions.  open() reads the header and fills r->info; row() gives
 * row r->y from the top, as stored: turning by the orientation tag and stretching to square pixels come after
 * it; what a format keeps between calls hangs on r->state.  Functions return 0, or -1 with words in e;
 * close() is called once after any open(), failed or not.
 */
#ifndef IMAGE_INTERNAL_H
#define IMAGE_INTERNAL_H

#include <stdio.h>

#include "base/outfile.h"
#include "image.h"

enum { IMG_HEAD = 4096 }; /* bytes of a file that sniff() gets to see */

typedef struct img_codec {
    const char *format;                                /* as in img_info */
    int (*sniff)(const unsigned char *head, size_t n); /* is it this format? */
    int (*open)(img_reader *r, errmsg *e);
    int (*row)(img_reader *r, float *row, errmsg *e);
    void (*close)(img_reader *r);
    int (*fact)(img_reader *r, const char *name, char *text,
                size_t room); /* as img_reader_fact(); may be NULL */
} img_codec;

struct img_reader {
    img_info info;  /* as the codec gives the rows: width and height as stored */
    img_info shown; /* as the caller gets them (image_shape.c) */
    img_open_opts opts;
    int turned;    /* the codec has turned the picture itself */
    int fractions; /* coded values need not be whole numbers */
    const img_codec *codec;
    const char *path; /* for messages; owned */
    FILE *f;          /* seekable, at its beginning when open() is called; owned */
    int64_t bytes;    /* size of the file */
    int y;            /* rows that the codec has given so far */
    int given;        /* rows that the caller has been given */
    int failed;
    struct img_shape *shape; /* NULL: rows go through as they are */
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

/* Print densities of a coded picture, in any unit: they say how it is to be printed and are often made up, so
 * that pixels are taken as square all the same; a remark where they are not equal. */
void img_density(const img_reader *r, double x, double y);

/* Turning and stretching between the codec's rows and the caller's. */
int img_shape_open(img_reader *r, errmsg *e);
int img_shape_row(img_reader *r, float *row, errmsg *e);
void img_shape_close(img_reader *r);

/* The matrix from the primaries and white xy (x, y of red, green, blue, white) to Rec. 709's: 1; 0 where it
 * is not needed, for Rec. 709's own and Radiance's; -1 where they make no colour space. */
int img_primaries(double m[3][3], const double xy[8]);

/* Orientation 1..8 that an EXIF block (a TIFF; "Exif\0\0" before it is skipped) states for its first picture,
 * else 1. */
int img_exif_orientation(const unsigned char *block, size_t n);

/* Of a panorama (GPano) in an XMP packet somewhere in the block: into panorama and pano, unless they say so
 * already. */
void img_xmp_panorama(img_info *info, const unsigned char *block, size_t n);

/* For TIFF and raw: is a TIFF one that holds camera raw data?  Leaves f where it was. */
int img_tiff_is_raw(FILE *f);

/* A picture whose stored rows aren't the shown rows from the top. */
typedef struct img_order {
    int columns; /* stored lines are columns */
    int flip_x;  /* from the right */
    int flip_y;  /* from the bottom */
} img_order;

/* Read all stored lines with next() into their places of a picture that is shown with w x h pixels of c
 * channels, kept in 1, 2 (whole numbers) or 4 (floats) bytes a value; it is the caller's (free). */
typedef int img_next(img_reader *r, float *line, errmsg *e);
int img_hold(void **held, int bytes, img_reader *r, int w, int h, int c, img_order order, img_next *next,
             errmsg *e);
void img_held(float *row, const void *held, int bytes, size_t first, size_t n); /* n values from first on */

/* Writers; each makes the whole file at o, which image.c commits.  path is for messages. */

int img_write_exr(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);
int img_write_hdr(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);
int img_write_png(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);

/* NULL, or the name of a picture format that is not read here and what converts it (image_foreign.c). */
const char *img_foreign(const unsigned char *head, size_t n);

#endif
