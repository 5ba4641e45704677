/*
 * image_raw.c - camera raw through LibRaw: demosaiced, the picture's own white balance as shot, linear, sRGB
 * primaries; 1 is where the first channel clips (its multiplier is 1).
 *
 * LibRaw gives balanced sensor values, not clipped (its `highlight` 1: the largest multiplier is 1, the
 * sensor's white is 65535 times a channel's); the matrix is applied here, so that colours beyond sRGB's stay
 * what they are (negative), and light that the sensor held is not cut at 1.  Where a channel is clipped
 * nothing is known beyond it: no channel is more than 1 there, so that such pixels are white, as LibRaw makes
 * them, and that is said.
 *
 * Whatever LibRaw would adapt to the picture's content (brightness, maximum, white balance from
 * the picture) is off, so that the pictures of an exposure series stay proportional to each other.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/remark.h"
#include "image_internal.h"
#include "rawfile.h"

static const int64_t file_max = (int64_t)1 << 30;

typedef struct raw_state {
    libraw_data_t *raw;
    void *file;
    libraw_processed_image_t *image;
    double scale[3], white[3]; /* 16 bit to balanced values; what the channel's clipped photosites come to */
    double matrix[3][3];       /* balanced values to sRGB's primaries */
    int64_t clipped;           /* pixels so far */
    int broken;
} raw_state;

/* ---- is it raw? ---------------------------------------------------------------------------------- */

static int begins(const unsigned char *head, size_t n, size_t at, const char *magic, size_t len)
{
    return n >= at + len && memcmp(head + at, magic, len) == 0;
}

/* The makers' own containers, and TIFF, which img_tiff_is_raw() looks into. */
static int raw_sniff(const unsigned char *head, size_t n)
{
    return img_codec_tiff.sniff(head, n) || begins(head, n, 0, "IIRO", 4) || begins(head, n, 0, "IIRS", 4) ||
           begins(head, n, 0, "MMOR", 4) || begins(head, n, 0, "IIU\0", 4) ||
           begins(head, n, 0, "FUJIFILM", 8) || begins(head, n, 0, "FOVb", 4) ||
           begins(head, n, 0, "\0MRM", 4) || begins(head, n, 6, "HEAPCCDR", 8) ||
           begins(head, n, 4, "ftypcrx ", 8);
}

static uint32_t number_at(const unsigned char *p, int bytes, int big)
{
    uint32_t v = 0;
    for (int i = 0; i < bytes; i++) v |= (uint32_t)p[big ? bytes - 1 - i : i] << (8 * i);
    return v;
}

/* A raw TIFF names its maker, and either its first picture is colour-filter data or that picture is
 * a preview; DNG and CR2 say what they are. */
int img_tiff_is_raw(FILE *f)
{
    enum {
        MAKE = 271,
        SUBFILE = 254,
        COMPRESSION = 259,
        PHOTOMETRIC = 262,
        DNG = 50706,
        OLD_JPEG = 6,
        LAST_KNOWN = 50000
    };
    unsigned char head[12], entry[12];
    int raw = 0, make = 0, hint = 0;
    int64_t back = ftello(f);
    if (fseeko(f, 0, SEEK_SET) == 0 && fread(head, 1, sizeof head, f) == sizeof head &&
        (head[2] == 42 || head[3] == 42)) {
        int big = head[0] == 'M';
        raw = head[8] == 'C' && head[9] == 'R';
        if (fseeko(f, number_at(head + 4, 4, big), SEEK_SET) == 0 && fread(entry, 1, 2, f) == 2) {
            uint32_t n = number_at(entry, 2, big);
            for (uint32_t i = 0; i < n && fread(entry, 1, 12, f) == 12; i++) {
                uint32_t tag = number_at(entry, 2, big), type = number_at(entry + 2, 2, big);
                uint32_t v = number_at(entry + 8, type == 3 ? 2 : 4, big);
                if (tag == DNG) raw = 1;
                if (tag == MAKE) make = 1;
                if (tag == SUBFILE && (v & 1)) hint = 1;
                if (tag == PHOTOMETRIC && (v == 32803 || v == 34892)) hint = 1;
                if (tag == COMPRESSION &&
                    (v == OLD_JPEG || (v > 32773 && v < 34000 && v != 32946) || v > LAST_KNOWN + 1))
                    hint = 1; /* a maker's own */
            }
        }
    }
    fseeko(f, back, SEEK_SET);
    return raw || (make && hint);
}

/* ---- reading --------------------------------------------------------------------------------------- */

static int raw_bad(const img_reader *r, errmsg *e, int rc)
{
    return img_bad(r, e, "broken or unknown camera raw file: %s", libraw_strerror(rc));
}

static int raw_open(img_reader *r, errmsg *e)
{
    raw_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    if (r->bytes > file_max) return img_bad(r, e, "expected a camera raw file of at most 1 GB");
    size_t size = (size_t)r->bytes;
    s->file = malloc(size);
    s->raw = rawfile_new(&s->broken);
    if (!s->file || !s->raw) return img_bad(r, e, "out of memory");
    if (fread(s->file, 1, size, r->f) != size) return img_bad(r, e, "can't read");
    libraw_output_params_t *p = &s->raw->params;
    p->use_auto_wb = 0;
    p->output_color = 0; /* balanced sensor values */
    p->gamm[0] = p->gamm[1] = 1;
    p->output_bps = 16;
    p->no_auto_bright = 1;
    p->adjust_maximum_thr = 0;
    p->highlight = 1; /* don't clip */
    int rc = libraw_open_buffer(s->raw, s->file, size);
    if (rawfile_white_lacks_black(s->raw, 0)) p->user_sat = (int)s->raw->color.maximum; /* it is taken off */
    r->info.orientation = rawfile_orientation(s->raw);
    p->user_flip = r->opts.keep_orientation ? 0 : -1; /* the library turns what it holds anyway */
    r->turned = 1;
    if (rc == LIBRAW_SUCCESS) rc = libraw_adjust_sizes_info_only(s->raw);
    if (rc != LIBRAW_SUCCESS) return raw_bad(r, e, rc);
    r->info.exposure_s = rawfile_stated(s->raw->other.shutter);
    r->info.f_number = rawfile_stated(s->raw->other.aperture);
    r->info.iso = rawfile_stated(s->raw->other.iso_speed);
    return img_set_info(r, s->raw->sizes.iwidth, s->raw->sizes.iheight, 3, 0, e);
}

static void raw_close(img_reader *r)
{
    raw_state *s = r->state;
    if (!s) return;
    if (s->image) libraw_dcraw_clear_mem(s->image);
    if (s->raw) libraw_close(s->raw);
    free(s->file);
    free(s);
}

/* After dcraw_process() pre_mul holds the multipliers that were used, the largest 1. */
static int colours(img_reader *r, raw_state *s, errmsg *e)
{
    const libraw_colordata_t *c = &s->raw->color;
    double least = 1;
    const int has_matrix = rawfile_matrix(s->matrix, s->raw, s->image->colors == 3);
    for (int i = 0; i < 3 && s->image->colors == 3; i++) least = fmin(least, (double)c->pre_mul[i]);
    if (!(least > 1e-5)) return img_bad(r, e, "expected white balance multipliers above 0, found %g", least);
    for (int i = 0; i < 3; i++) {
        s->scale[i] = 1 / (65535 * least);
        s->white[i] = s->image->colors == 3 ? (double)c->pre_mul[i] / least : 1;
    }
    if (s->image->colors == 3)
        remark(r->path, "camera raw developed by itself: %s%s",
               c->cam_mul[0] > 0 && c->cam_mul[2] > 0 ? "white balance as this picture was shot"
                                                      : "daylight's white balance, as none is stated",
               has_matrix ? "" : ", colours as the camera's, as its matrix is unknown");
    return 0;
}

/* LibRaw changes sizes between the steps: adjust_sizes_info_only() is undone by opening again. */
static int develop(img_reader *r, raw_state *s, errmsg *e)
{
    libraw_recycle(s->raw);
    int rc = libraw_open_buffer(s->raw, s->file, (size_t)r->bytes);
    if (rc == LIBRAW_SUCCESS) rc = libraw_unpack(s->raw);
    if (rc == LIBRAW_SUCCESS) rc = libraw_dcraw_process(s->raw);
    if (rc == LIBRAW_SUCCESS) s->image = libraw_dcraw_make_mem_image(s->raw, &rc);
    if (!s->image) return raw_bad(r, e, rc);
    if (s->broken) return img_bad(r, e, "broken camera raw file: pixels missing or damaged");
    if (s->image->type != LIBRAW_IMAGE_BITMAP || s->image->bits != 16 || s->image->width != r->info.width ||
        s->image->height != r->info.height || (s->image->colors != 3 && s->image->colors != 1))
        return img_bad(r, e, "expected a raw picture of %dx%d pixels, found %dx%d with %d channels",
                       r->info.width, r->info.height, s->image->width, s->image->height, s->image->colors);
    return colours(r, s, e);
}

static int raw_row(img_reader *r, float *row, errmsg *e)
{
    static const double at_white = 0.999; /* what interpolation leaves of it */
    raw_state *s = r->state;
    if (!s->image && develop(r, s, e) < 0) return -1;
    size_t w = (size_t)r->info.width, nc = s->image->colors;
    const unsigned char *p = s->image->data + (size_t)r->y * w * nc * 2;
    for (size_t x = 0; x < w; x++) {
        double v[3];
        int clipped = 0;
        for (size_t c = 0; c < 3; c++) {
            uint16_t code;
            memcpy(&code, p + 2 * (nc == 3 ? 3 * x + c : x), sizeof code);
            v[c] = code * s->scale[c];
            clipped |= v[c] >= at_white * s->white[c];
        }
        for (int c = 0; c < 3 && clipped; c++) v[c] = fmin(v[c], 1);
        s->clipped += clipped;
        for (size_t c = 0; c < 3; c++)
            row[3 * x + c] =
                (float)(s->matrix[c][0] * v[0] + s->matrix[c][1] * v[1] + s->matrix[c][2] * v[2]);
    }
    if (r->y + 1 == r->info.height && s->clipped)
        remark(r->path, "%lld pixels (%.3g %%) clipped in the sensor: they are at least as bright as given",
               (long long)s->clipped, 100.0 * (double)s->clipped / ((double)r->info.width * r->info.height));
    return 0;
}

const img_codec img_codec_raw = {"raw", raw_sniff, raw_open, raw_row, raw_close, NULL};
