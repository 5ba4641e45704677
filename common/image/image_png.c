/*
 * image_png.c - PNG in (8 and 16 bit; palettes and fewer bits expanded to 8; codes as stored, no
 * gamma) and out (8 bit).  Interlaced pictures are held, the others stream.
 */
#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

#include "image_internal.h"

enum { FACTS_MAX = 1 << 20 }; /* bytes of an EXIF or XMP block that is looked at */

typedef struct png_state {
    png_structp png;
    png_infop info;
    int bytes; /* of a sample */
    size_t row_bytes;
    unsigned char *rows; /* one row, or all of them when interlaced */
    unsigned char **row_at;
    int interlaced, whole;
    char words[200];
} png_state;

static void keep_error(png_structp png, png_const_charp words)
{
    char *to = png_get_error_ptr(png);
    if (to) snprintf(to, sizeof((png_state *)0)->words, "%s", words);
    png_longjmp(png, 1);
}

static void no_warning(png_structp png, png_const_charp words)
{
    (void)png;
    (void)words;
}

static int png_sniff(const unsigned char *head, size_t n)
{
    return n >= 8 && png_sig_cmp(head, 0, 8) == 0;
}

static int png_bad(const img_reader *r, errmsg *e)
{
    return img_bad(r, e, "broken PNG file: %s", ((png_state *)r->state)->words);
}

/* eXIf may stand before or after the pixels: walk the chunks.  Broken ones are libpng's to complain of. */
static void png_facts(img_reader *r)
{
    unsigned char head[8];
    int64_t at = 8, back = ftello(r->f);
    while (at + 12 <= r->bytes && fseeko(r->f, at, SEEK_SET) == 0 && fread(head, 1, 8, r->f) == 8) {
        int64_t size = png_get_uint_32(head);
        int exif = memcmp(head + 4, "eXIf", 4) == 0, text = memcmp(head + 4, "iTXt", 4) == 0;
        if ((exif || text) && size <= FACTS_MAX && at + 12 + size <= r->bytes) {
            unsigned char *block = malloc((size_t)size + 1);
            if (block && fread(block, 1, (size_t)size, r->f) == (size_t)size) {
                if (exif) r->info.orientation = img_exif_orientation(block, (size_t)size);
                if (text) img_xmp_panorama(&r->info, block, (size_t)size);
            }
            free(block);
        }
        if (memcmp(head + 4, "IEND", 4) == 0) break;
        at += 12 + size;
    }
    fseeko(r->f, back, SEEK_SET);
}

static int png_open(img_reader *r, errmsg *e)
{
    png_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    s->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, s->words, keep_error, no_warning);
    if (s->png) s->info = png_create_info_struct(s->png);
    if (!s->info) return img_bad(r, e, "out of memory");
    if (setjmp(png_jmpbuf(s->png))) return png_bad(r, e);
    png_facts(r);
    png_set_user_limits(s->png, IMG_MAX_SIDE, IMG_MAX_SIDE);
    png_init_io(s->png, r->f);
    png_read_info(s->png, s->info);
    if (img_check_size(r->path, png_get_image_width(s->png, s->info), png_get_image_height(s->png, s->info),
                       e) < 0)
        return -1;
    png_set_expand(s->png);
    png_uint_32 density[2] = {0, 0}; /* its ratio counts in either unit */
    int unit = 0;
    png_get_pHYs(s->png, s->info, &density[0], &density[1], &unit);
    img_density(r, density[0], density[1]);
    s->interlaced = png_set_interlace_handling(s->png) > 1;
    png_read_update_info(s->png, s->info);
    s->bytes = png_get_bit_depth(s->png, s->info) == 16 ? 2 : 1;
    s->row_bytes = png_get_rowbytes(s->png, s->info);
    int channels = png_get_channels(s->png, s->info);
    if (channels < 1 || channels > 4) return img_bad(r, e, "expected 1 to 4 channels, found %d", channels);
    return img_set_info(r, png_get_image_width(s->png, s->info), png_get_image_height(s->png, s->info),
                        channels, s->bytes == 2 ? 65535 : 255, e);
}

static void png_close(img_reader *r)
{
    png_state *s = r->state;
    if (!s) return;
    if (s->png) png_destroy_read_struct(&s->png, s->info ? &s->info : NULL, NULL);
    free(s->rows);
    free(s->row_at);
    free(s);
}

static int png_prepare(img_reader *r, png_state *s, errmsg *e)
{
    size_t n = s->interlaced ? (size_t)r->info.height : 1;
    s->rows = malloc(n * s->row_bytes);
    s->row_at = malloc(n * sizeof *s->row_at);
    if (!s->rows || !s->row_at) return img_bad(r, e, "out of memory");
    for (size_t y = 0; y < n; y++) s->row_at[y] = s->rows + y * s->row_bytes;
    return 0;
}

static int png_row(img_reader *r, float *row, errmsg *e)
{
    png_state *s = r->state;
    if (!s->rows && png_prepare(r, s, e) < 0) return -1;
    if (setjmp(png_jmpbuf(s->png))) return png_bad(r, e);
    if (!s->interlaced) {
        png_read_row(s->png, s->rows, NULL);
    } else if (!s->whole) {
        png_read_image(s->png, s->row_at);
        s->whole = 1;
    }
    const unsigned char *p = s->interlaced ? s->row_at[r->y] : s->rows;
    size_t n = (size_t)r->info.width * (size_t)r->info.channels;
    if (s->bytes == 1) {
        for (size_t i = 0; i < n; i++) row[i] = p[i];
    } else {
        for (size_t i = 0; i < n; i++) row[i] = (float)(p[2 * i] << 8 | p[2 * i + 1]);
    }
    return 0;
}

const img_codec img_codec_png = {"png", png_sniff, png_open, png_row, png_close, NULL};

/* ---- writing ----------------------------------------------------------------------------------- */

static unsigned char to_byte(double v)
{
    return (unsigned char)(v <= 0 ? 0 : v >= 255 ? 255 : floor(v + 0.5));
}

static unsigned char encode(double v, int coded, double scale, int alpha)
{
    if (coded) return to_byte(v * scale);
    if (alpha) return to_byte(v * 255);
    return to_byte(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055));
}

static void png_write_all(png_structp png, png_infop info, const img *im, FILE *f, const char *comment,
                          unsigned char *line)
{
    static const int colour[4] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                  PNG_COLOR_TYPE_RGB_ALPHA};
    int w = im->info.width, h = im->info.height, nc = im->info.channels;
    double scale = im->info.max_code > 0 ? 255 / im->info.max_code : 1;
    png_set_user_limits(png, IMG_MAX_SIDE, IMG_MAX_SIDE);
    png_init_io(png, f);
    png_set_IHDR(png, info, (png_uint_32)w, (png_uint_32)h, 8, colour[nc - 1], PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
    if (comment) {
        png_text text = {.compression = PNG_TEXT_COMPRESSION_NONE};
        char key[] = "Comment";
        text.key = key;
        text.text = (char *)comment;
        png_set_text(png, info, &text, 1);
    }
    png_write_info(png, info);
    size_t n = (size_t)w * (size_t)nc;
    for (int y = 0; y < h; y++) {
        const float *p = im->pix + (size_t)y * n;
        for (size_t i = 0; i < n; i++) {
            int alpha = (nc == 2 || nc == 4) && i % (size_t)nc == (size_t)nc - 1;
            line[i] = encode((double)p[i], im->info.coded, scale, alpha);
        }
        png_write_row(png, line);
    }
    png_write_end(png, info);
}

int img_write_png(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e)
{
    char words[sizeof((png_state *)0)->words] = "";
    png_infop info = NULL;
    unsigned char *line = malloc((size_t)im->info.width * (size_t)im->info.channels);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, words, keep_error, no_warning);
    if (png) info = png_create_info_struct(png);
    volatile int rc = 0;
    if (!line || !info) rc = err_set(e, "%s: out of memory", path);
    else if (setjmp(png_jmpbuf(png))) rc = err_set(e, "%s: can't write PNG: %s", path, words);
    else png_write_all(png, info, im, out_stream(o), opts->comment, line);
    if (png) png_destroy_write_struct(&png, info ? &info : NULL);
    free(line);
    return rc;
}
