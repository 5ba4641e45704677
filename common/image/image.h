/*
 * image.h - pictures in and out.
 *
 * In:  OpenEXR (scan line or tiled; parts, layers and views: image_exr_choose.c; windows, alpha and
 *      primaries: image_exr.c), Radiance .hdr (RGBE and XYZE, old and new run lengths, any orientation),
 *      PNG, JPEG, TIFF, PNM (P2 P3 P5 P6 and PFM), 8 and 16 bit, and what LibRaw knows.  The content
 *      decides, not the name.
 * Out: OpenEXR, Radiance .hdr, PNG (8 bit), by the name's ending.
 *
 * Layout: row-major, top row first, channels interleaved: pix[(y*width + x)*channels + c],
 * c = R, G, B(, A) or grey(, A).  Pixel (x, y) covers [x, x+1) x [y, y+1) with (0, 0) the
 * top-left corner of the picture: centres at +1/2.
 *
 * Values: radiometric formats (EXR, .hdr, PFM, raw) give radiance as the file means it (.hdr:
 * divided by EXPOSURE and COLORCORR).  Coded formats (PNG, JPEG, TIFF, PNM integers) give the raw code
 * numbers 0..max_code, untouched by any transfer curve; who reads decides what they mean.  Colours are not
 * multiplied by alpha (where a file's are, they are divided by it).  What was assumed goes to remark.h.
 */
#ifndef IMAGE_H
#define IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "base/errmsg.h"

/* Pictures larger than this in either direction, or of more than IMG_MAX_PIXELS, are
 * refused before memory is taken. */
#define IMG_MAX_SIDE   (1 << 17)
#define IMG_MAX_PIXELS ((int64_t)1 << 31)

/* What a file states about its equirectangular panorama (XMP's namespace GPano; ilf:latlong and ilf:pose in .exr and .hdr),
 * each group 0 where it is not stated. */
typedef struct img_panorama {
    double
        shows_deg[4]; /* longitudes of the left and right edge (0: the whole panorama's middle, growing to the
                            right), latitudes of the upper and lower edge: as stated, be it possible or not */
    double aspect;    /* width over height, in pixels, that the picture should have for it */
    int has_pose[3];  /* of each angle: 1 where it is stated */
    double pose_deg[3]; /* the camera's heading (compass: clockwise from north), pitch (nose up), roll (right
                           side down) */
} img_panorama;

typedef struct img_info {
    int width, height; /* pixels, of the picture as it is given: turned and stretched */
    int channels;      /* 1 grey, 2 grey+alpha, 3 RGB, 4 RGB+alpha */
    int coded;         /* 1: values are codes 0..max_code, 0: radiometric */
    double max_code;   /* 255, 65535, ... ; 0 when radiometric */
    char format[8];    /* "exr", "hdr", "png", "jpeg", "tiff", "pnm", "pfm", "raw" */
    /* Photographic facts where the file states them (EXIF, raw, EXR header), else 0. */
    double exposure_s, f_number, iso;
    /* As the file states them, whatever was made of them: */
    int orientation;     /* 1..8, EXIF's and TIFF's numbers; 1 when not stated */
    double pixel_aspect; /* a pixel's height over its width, as stored; 1 when not stated */
    int cropped;         /* 1: the file holds a part only (EXR data window); alpha 0 is what it leaves open */
    int panorama;        /* 1: the file says that it is an equirectangular panorama (EXR envmap, GPano) */
    img_panorama pano;   /* and what more it says of it */
} img_info;

/* How to take a picture; zeroes are the defaults, and so is NULL where one is expected.
 *
 * Orientation.  One rule for all formats (EXIF in JPEG and PNG, TIFF's tag, what LibRaw finds in camera raw):
 * the tag says how the picture is to be looked at, and rows and pixel coordinates are those of the turned
 * picture.  keep_orientation gives the pixels as they lie in the file: for a series, whose pictures lie alike
 * on the sensor whatever the tags say (a camera that looks straight up or down sets them by chance).  A
 * Radiance picture's resolution line is part of its layout, not such a tag: always honoured.
 *
 * Pixels that are not square (PIXASPECT in .hdr, pixelAspectRatio in EXR) are stretched along their longer
 * side: each output pixel is the mean of what it covers.  keep_aspect leaves them: for charts whose rows and
 * columns are angles whatever a pixel looks like.  Print densities of PNG, JPEG and TIFF are only remarked
 * on. */
typedef struct img_open_opts {
    int keep_orientation;
    int keep_aspect;
    const char *layer; /* EXR: name of the layer, part or view to take; a single channel gives grey */
} img_open_opts;

typedef struct img {
    img_info info;
    float *pix; /* width*height*channels, owned */
} img;

/* Whole picture.  *im is overwritten on success, untouched on failure. */
int img_load(img *im, const char *path, errmsg *e);
int img_load_as(img *im, const char *path, const img_open_opts *opts, errmsg *e);
void img_free(img *im); /* and zero it */

/* Allocate a zeroed radiometric picture.  Refuses sizes over the limits. */
int img_alloc(img *im, int width, int height, int channels, errmsg *e);

/* Turn codes into relative linear light in place by the sRGB curve (IEC 61966-2-1), code
 * max_code -> 1; does nothing to a radiometric picture.  Alpha stays linear. */
void img_linearise_srgb(img *im);

/* Header of a picture only. */
int img_probe(img_info *info, const char *path, errmsg *e);
int img_probe_as(img_info *info, const char *path, const img_open_opts *opts, errmsg *e);

/* Row stream: for series too large to hold.  Rows come from the top; formats that can't
 * stream (progressive JPEG, interlaced PNG, bottom-up .hdr), and pictures to be turned, are held inside.
 * One reader is for one thread at a time; different readers are independent. */
typedef struct img_reader img_reader;
int img_reader_open(img_reader **r, const char *path, errmsg *e);
int img_reader_open_as(img_reader **r, const char *path, const img_open_opts *opts, errmsg *e);
const img_info *img_reader_info(const img_reader *r);
/* What the header states under this name (EXR: a number or string attribute; .hdr: a line NAME=value), as
 * text: 1 and text, or 0.  Before or between rows. */
int img_reader_fact(img_reader *r, const char *name, char *text, size_t room);
int img_reader_rows(img_reader *r, float *rows, int nrows, errmsg *e); /* next nrows rows */
void img_reader_close(img_reader *r);                                  /* NULL allowed */

typedef enum img_type { IMG_HALF, IMG_FLOAT } img_type;

/* One extra channel of an EXR (sigma, flags ...), or one attribute. */
typedef struct img_plane {
    const char *name; /* EXR channel name, e.g. "sigma.R" */
    const float *pix; /* width*height, or the first of a strided set */
    size_t stride;    /* floats from one pixel to the next */
    img_type type;
} img_plane;
typedef struct img_attr {
    const char *name;
    enum {
        IMG_ATTR_STRING,
        IMG_ATTR_FLOAT,
        IMG_ATTR_V3F,
        IMG_ATTR_INT,
        IMG_ATTR_FLOATS,
        IMG_ATTR_CHROMATICITIES
    } kind;
    const char *s;
    double v[3];    /* FLOAT: v[0]; V3F: v[0..2]; INT: v[0] */
    const float *f; /* FLOATS: n values (floatvector); CHROMATICITIES: x, y of red, green, blue, white (.hdr:
                       PRIMARIES=) */
    int n;
} img_attr;

typedef struct img_write_opts {
    img_type type;           /* EXR: HALF or FLOAT for R, G, B, A */
    const char *compression; /* EXR: none rle zips zip piz dwaa; NULL = zip */
    const img_plane *planes; /* EXR only */
    int nplanes;
    const img_attr *attrs; /* EXR: attributes; .hdr: NAME=value header lines */
    int nattrs;
    const char *comment; /* EXR "comments"; .hdr: a header line (the command line) */
} img_write_opts;

/* Write atomically (outfile.h); the ending of path picks the format, "-" is .hdr to stdout.
 * HALF output with a finite value beyond 65504 is refused (choose FLOAT or scale).  PNG: values are
 * taken as codes 0..255 when info.coded, else as linear light with 1 = white, sRGB-encoded.
 * opts may be NULL (HALF if all values fit, else FLOAT; zip). */
int img_write(const img *im, const char *path, const img_write_opts *opts, errmsg *e);

#endif
