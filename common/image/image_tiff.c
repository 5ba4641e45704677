/*
 * image_tiff.c - TIFF in through libtiff: grey, RGB or palette, 8 or 16 bit codes or 32 bit float
 * (taken as radiance), strips or tiles, both planar configurations, alpha where declared; the first
 * picture of the file.
 *
 * Strips of one plane stream line by line; separate planes keep a strip of each, tiles a row of
 * tiles.  Associated alpha (colours multiplied by it) is divided out.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <tiffio.h>
#include <unistd.h>

#include "image_internal.h"

static const uint64_t buffer_max = (uint64_t)1 << 31; /* bytes of a strip or tile */

typedef struct tiff_state {
    TIFF *tif;
    uint32_t width, height, rows; /* rows of a strip or tile */
    uint16_t bits, samples, photometric;
    int is_float, separate, tiled, palette;
    int multiplied; /* colours are multiplied by alpha (associated) */
    uint32_t tile_w;
    uint16_t *map[3];      /* palette, libtiff's */
    size_t unit, unit_row; /* bytes of a strip or tile, and of its line */
    size_t units;          /* buffers held: planes, times tiles of a row */
    unsigned char *buf;
    uint32_t band; /* which row of strips or tiles is in buf; UINT32_MAX: none */
} tiff_state;

/* What libtiff said, kept per thread.  Its global handlers are anybody's (whoever reads EXIF data turns them
 * off): each file has a handler of its own. */
static _Thread_local char last_words[200];

static int keep_words(TIFF *tif, void *user, const char *module, const char *fmt, va_list ap)
{
    (void)tif, (void)user, (void)module;
    vsnprintf(last_words, sizeof last_words, fmt, ap);
    return 1; /* nobody else need hear it */
}

static int no_words(TIFF *tif, void *user, const char *module, const char *fmt, va_list ap)
{
    (void)tif, (void)user, (void)module, (void)fmt, (void)ap;
    return 1;
}

static TIFF *open_with_words(int fd, const char *path)
{
    TIFFOpenOptions *o = TIFFOpenOptionsAlloc();
    if (!o) return NULL;
    TIFFOpenOptionsSetErrorHandlerExtR(o, keep_words, NULL);
    TIFFOpenOptionsSetWarningHandlerExtR(o, no_words, NULL);
    TIFF *tif = TIFFFdOpenExt(fd, path, "rm", o); /* m: not mapped, so that a shrinking file is no SIGBUS */
    TIFFOpenOptionsFree(o);
    return tif;
}

static int tiff_bad(const img_reader *r, errmsg *e, const char *what)
{
    return img_bad(r, e, "broken TIFF file: %s%s%s", what, last_words[0] ? ": " : "", last_words);
}

static int tiff_sniff(const unsigned char *head, size_t n)
{
    if (n < 8) return 0;
    return memcmp(head, "II*\0", 4) == 0 || memcmp(head, "MM\0*", 4) == 0 || memcmp(head, "II+\0", 4) == 0 ||
           memcmp(head, "MM\0+", 4) == 0;
}

/* ---- header ------------------------------------------------------------------------------------ */

/* What the samples mean; returns channels or -1. */
static int read_layout(img_reader *r, tiff_state *s, errmsg *e)
{
    uint16_t format = SAMPLEFORMAT_UINT, config = PLANARCONFIG_CONTIG, extra = 0, *kinds = NULL;
    uint16_t compression = COMPRESSION_NONE;
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_BITSPERSAMPLE, &s->bits);
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_SAMPLESPERPIXEL, &s->samples);
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_SAMPLEFORMAT, &format);
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_PLANARCONFIG, &config);
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_EXTRASAMPLES, &extra, &kinds);
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_COMPRESSION, &compression);
    if (!TIFFGetField(s->tif, TIFFTAG_PHOTOMETRIC, &s->photometric)) s->photometric = PHOTOMETRIC_MINISBLACK;
    if (!TIFFIsCODECConfigured(compression))
        return img_bad(r, e, "expected a TIFF compression that is known, found number %d", compression);
    if (s->photometric == PHOTOMETRIC_YCBCR && compression == COMPRESSION_JPEG) {
        TIFFSetField(s->tif, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
        s->photometric = PHOTOMETRIC_RGB;
    }
    s->is_float = format == SAMPLEFORMAT_IEEEFP && s->bits == 32;
    if (!s->is_float &&
        !((format == SAMPLEFORMAT_UINT || format == SAMPLEFORMAT_VOID) && (s->bits == 8 || s->bits == 16)))
        return img_bad(r, e,
                       "expected 8 or 16 bit unsigned or 32 bit float samples, found %d bit of format %d",
                       s->bits, format);
    s->palette = s->photometric == PHOTOMETRIC_PALETTE;
    int colours = s->photometric == PHOTOMETRIC_RGB ? 3 : 1;
    if (colours == 1 && s->photometric > PHOTOMETRIC_MINISBLACK && !s->palette)
        return img_bad(r, e, "expected a grey, RGB or palette TIFF, found photometric interpretation %d",
                       s->photometric);
    if (s->samples < colours || (s->palette && (s->samples != 1 || s->is_float)))
        return img_bad(r, e, "expected %d samples a pixel, found %d", colours, s->samples);
    if (s->palette && !TIFFGetField(s->tif, TIFFTAG_COLORMAP, &s->map[0], &s->map[1], &s->map[2]))
        return img_bad(r, e, "expected a palette, found none");
    s->separate = config == PLANARCONFIG_SEPARATE && s->samples > 1;
    int alpha = s->samples > colours && extra > 0 && kinds &&
                (kinds[0] == EXTRASAMPLE_ASSOCALPHA || kinds[0] == EXTRASAMPLE_UNASSALPHA);
    s->multiplied = r->fractions = alpha && kinds[0] == EXTRASAMPLE_ASSOCALPHA;
    return s->palette ? 3 : colours + alpha;
}

static int read_units(img_reader *r, tiff_state *s, errmsg *e)
{
    uint64_t unit, unit_row;
    s->tiled = TIFFIsTiled(s->tif);
    if (s->tiled) {
        if (!TIFFGetField(s->tif, TIFFTAG_TILEWIDTH, &s->tile_w) ||
            !TIFFGetField(s->tif, TIFFTAG_TILELENGTH, &s->rows))
            return tiff_bad(r, e, "no tile size");
        unit = TIFFTileSize64(s->tif);
        unit_row = TIFFTileRowSize64(s->tif);
    } else {
        TIFFGetFieldDefaulted(s->tif, TIFFTAG_ROWSPERSTRIP, &s->rows);
        if (s->rows > s->height) s->rows = s->height;
        unit = s->separate ? TIFFStripSize64(s->tif) : TIFFScanlineSize64(s->tif);
        unit_row = TIFFScanlineSize64(s->tif);
    }
    uint64_t across = s->tiled && s->tile_w ? ((uint64_t)s->width + s->tile_w - 1) / s->tile_w : 1;
    uint64_t planes = s->separate ? s->samples : 1;
    uint64_t columns = s->tiled ? s->tile_w : s->width;
    uint64_t row_needs = columns * (s->separate ? 1u : s->samples) * (s->bits / 8u);
    if (s->rows < 1 || columns < 1 || unit < 1 || unit > buffer_max || unit_row < row_needs ||
        unit > buffer_max * 4 / (across * planes))
        return tiff_bad(r, e, "strips or tiles of an unreasonable size");
    uint64_t lines = s->tiled || s->separate ? s->rows : 1;
    if (unit < unit_row * lines) return tiff_bad(r, e, "strips or tiles of an unreasonable size");
    s->unit = (size_t)unit;
    s->unit_row = (size_t)unit_row;
    s->units = (size_t)(across * planes);
    return 0;
}

static int tiff_open(img_reader *r, errmsg *e)
{
    tiff_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    s->band = UINT32_MAX;
    last_words[0] = 0;
    int fd = dup(fileno(r->f)); /* TIFFClose closes it */
    if (fd < 0) return img_bad(r, e, "too many open files");
    lseek(fd, 0, SEEK_SET);
    s->tif = open_with_words(fd, r->path);
    if (!s->tif) {
        close(fd);
        return tiff_bad(r, e, "header");
    }
    TIFFGetField(s->tif, TIFFTAG_IMAGEWIDTH, &s->width);
    TIFFGetField(s->tif, TIFFTAG_IMAGELENGTH, &s->height);
    if (img_check_size(r->path, s->width, s->height, e) < 0) return -1;
    int channels = read_layout(r, s, e);
    if (channels < 0) return -1;
    double max = s->is_float ? 0 : s->bits == 16 || s->palette ? 65535 : 255;
    uint16_t orientation = ORIENTATION_TOPLEFT;
    TIFFGetFieldDefaulted(s->tif, TIFFTAG_ORIENTATION, &orientation);
    float res[2] = {0, 0};
    if (TIFFGetField(s->tif, TIFFTAG_XRESOLUTION, &res[0]) &&
        TIFFGetField(s->tif, TIFFTAG_YRESOLUTION, &res[1]))
        img_density(r, (double)res[0], (double)res[1]);
    uint32_t xmp_size = 0;
    void *xmp = NULL;
    if (TIFFGetField(s->tif, TIFFTAG_XMLPACKET, &xmp_size, &xmp) && xmp)
        img_xmp_panorama(&r->info, xmp, xmp_size);
    r->info.orientation = orientation >= 1 && orientation <= 8 ? orientation : ORIENTATION_TOPLEFT;
    if (img_set_info(r, s->width, s->height, channels, max, e) < 0) return -1;
    return read_units(r, s, e);
}

static void tiff_close(img_reader *r)
{
    tiff_state *s = r->state;
    if (!s) return;
    if (s->tif) TIFFClose(s->tif);
    free(s->buf);
    free(s);
}

/* ---- pixels ------------------------------------------------------------------------------------ */

/* Bring the strips or tiles that hold stored line y into buf: unit u is tile (or 0) + across * plane. */
static int read_band(img_reader *r, tiff_state *s, uint32_t y, errmsg *e)
{
    if (!s->tiled && !s->separate)
        return TIFFReadScanline(s->tif, s->buf, y, 0) == 1 ? 0 : tiff_bad(r, e, "pixels");
    uint32_t band = y / s->rows;
    if (band == s->band) return 0;
    uint16_t planes = s->separate ? s->samples : 1;
    size_t across = s->units / planes;
    for (uint16_t p = 0; p < planes; p++) {
        for (size_t t = 0; t < across; t++) {
            unsigned char *to = s->buf + (p * across + t) * s->unit;
            tmsize_t got, want = (tmsize_t)s->unit;
            if (s->tiled) {
                uint32_t tile = TIFFComputeTile(s->tif, (uint32_t)t * s->tile_w, y, 0, p);
                got = TIFFReadEncodedTile(s->tif, tile, to, want);
            } else {
                uint32_t left = s->height - band * s->rows, lines = left < s->rows ? left : s->rows;
                want = (tmsize_t)(lines * s->unit_row);
                got = TIFFReadEncodedStrip(s->tif, TIFFComputeStrip(s->tif, y, p), to, want);
            }
            if (got != want) return tiff_bad(r, e, "pixels");
        }
    }
    s->band = band;
    return 0;
}

static double sample_at(const tiff_state *s, const unsigned char *p)
{
    if (s->bits == 8) return p[0];
    if (s->bits == 16) {
        uint16_t v;
        memcpy(&v, p, sizeof v); /* libtiff has turned the bytes */
        return v;
    }
    float v;
    memcpy(&v, p, sizeof v);
    return (double)v;
}

/* Colours as they were before they were multiplied by alpha, as codes no more than the largest. */
static void divide_alpha(float *p, size_t nc, double max)
{
    double alpha = (double)p[nc - 1] / (max > 0 ? max : 1);
    for (size_t c = 0; c + 1 < nc && alpha > 0 && alpha < 1; c++) {
        double v = (double)p[c] / alpha;
        p[c] = (float)(max > 0 && v > max ? max : v);
    }
}

static int tiff_row(img_reader *r, float *line, errmsg *e)
{
    tiff_state *s = r->state;
    uint32_t y = (uint32_t)r->y;
    size_t nc = (size_t)r->info.channels, bytes = s->bits / 8u,
           across = s->units / (s->separate ? s->samples : 1u);
    last_words[0] = 0;
    if (!s->buf) {
        s->buf = calloc(s->units, s->unit);
        if (!s->buf) return img_bad(r, e, "out of memory");
    }
    if (read_band(r, s, y, e) < 0) return -1;
    size_t in_unit = s->tiled || s->separate ? y % s->rows : 0;
    size_t file_channels = s->palette ? 1 : nc;
    for (size_t x = 0; x < s->width; x++) {
        size_t tile = s->tiled ? x / s->tile_w : 0, col = s->tiled ? x % s->tile_w : x;
        for (size_t c = 0; c < file_channels; c++) {
            const unsigned char *p = s->buf + in_unit * s->unit_row;
            if (s->separate) p += (c * across + tile) * s->unit + col * bytes;
            else p += tile * s->unit + (col * s->samples + c) * bytes;
            double v = sample_at(s, p);
            if (s->palette) {
                for (size_t k = 0; k < 3; k++) line[3 * x + k] = s->map[k][(size_t)v];
            } else {
                int inverted = s->photometric == PHOTOMETRIC_MINISWHITE && c == 0 && !s->is_float;
                line[nc * x + c] = (float)(inverted ? r->info.max_code - v : v);
            }
        }
        if (s->multiplied) divide_alpha(line + nc * x, nc, r->info.max_code);
    }
    return 0;
}

const img_codec img_codec_tiff = {"tiff", tiff_sniff, tiff_open, tiff_row, tiff_close, NULL};
