/*
 * exif.c - see exif.h.  Exif 2.3, section 4.6.5: ExposureTime 0x829A, else 2^-ShutterSpeedValue 0x9201;
 * FNumber 0x829D, else 2^(ApertureValue/2) 0x9202 (both APEX); PhotographicSensitivity 0x8827, which has 16
 * bits: where it says 65535 or nothing, SensitivityType 0x8830 says which of 0x8831, 0x8832, 0x8833 counts.
 */
#include "exif.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <libexif/exif-data.h>
#include <tiffio.h>

enum { ISO_FULL = 65535 };

/* What a block states; NAN: nothing that is a number. */
typedef struct stated {
    double time, shutter_apex, f_number, aperture_apex, iso, type, standard, recommended, speed;
} stated;

static const stated nothing = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};

static double plausible(double v)
{
    return isfinite(v) && v > 0 && v < 1e9 ? v : 0;
}

static double iso_of(const stated *s)
{
    double by_type[8] = {NAN,      s->standard,    s->recommended, s->speed, s->recommended,
                         s->speed, s->recommended, s->recommended};
    double iso = plausible(s->iso);
    if (iso > 0 && iso < ISO_FULL) return iso;
    if (s->type >= 1 && s->type <= 7 && plausible(by_type[(int)s->type]) > 0)
        return plausible(by_type[(int)s->type]);
    double other = plausible(s->recommended);
    other = other > 0 ? other : plausible(s->speed);
    other = other > 0 ? other : plausible(s->standard);
    return other > 0 ? other : iso;
}

static exif_facts settle(const stated *s)
{
    exif_facts f = {plausible(s->time), plausible(s->f_number), iso_of(s)};
    if (!(f.exposure_s > 0)) f.exposure_s = plausible(exp2(-s->shutter_apex));
    if (!(f.f_number > 0) &&
        s->aperture_apex > 0) /* 0 is f/1, and what cameras write that don't know the lens */
        f.f_number = plausible(exp2(s->aperture_apex / 2));
    return f;
}

/* ---- libexif ---------------------------------------------------------------------------------------------
 */

static double number(ExifData *d, unsigned tag)
{
    ExifEntry *x = exif_data_get_entry(d, (ExifTag)tag);
    ExifByteOrder order = exif_data_get_byte_order(d);
    if (!x || !x->data || x->components < 1) return NAN;
    if (x->format == EXIF_FORMAT_RATIONAL && x->size >= 8) {
        ExifRational r = exif_get_rational(x->data, order);
        return r.denominator ? (double)r.numerator / r.denominator : NAN;
    }
    if (x->format == EXIF_FORMAT_SRATIONAL && x->size >= 8) {
        ExifSRational r = exif_get_srational(x->data, order);
        return r.denominator ? (double)r.numerator / r.denominator : NAN;
    }
    if (x->format == EXIF_FORMAT_SHORT && x->size >= 2) return exif_get_short(x->data, order);
    if (x->format == EXIF_FORMAT_LONG && x->size >= 4) return exif_get_long(x->data, order);
    return NAN;
}

/* block: "Exif\0\0", then a TIFF. */
static stated from_block(const unsigned char *block, unsigned n)
{
    stated s = nothing;
    ExifData *d = exif_data_new();
    if (!d) return s;
    exif_data_unset_option(d, EXIF_DATA_OPTION_FOLLOW_SPECIFICATION); /* it would fill in what is missing */
    exif_data_load_data(d, block, n);
    s.time = number(d, 0x829A);
    s.shutter_apex = number(d, 0x9201);
    s.f_number = number(d, 0x829D);
    s.aperture_apex = number(d, 0x9202);
    s.iso = number(d, 0x8827);
    s.type = number(d, 0x8830);
    s.standard = number(d, 0x8831);
    s.recommended = number(d, 0x8832);
    s.speed = number(d, 0x8833);
    exif_data_unref(d);
    return s;
}

static unsigned big_endian(const unsigned char *p, int bytes)
{
    unsigned v = 0;
    for (int i = 0; i < bytes; i++) v = v << 8 | p[i];
    return v;
}

/* The first APP1 segment that is Exif; others (XMP) may come before it. */
static stated from_jpeg(FILE *in)
{
    enum { APP1 = 0xe1, SOS = 0xda, LONGEST = 65535 };
    unsigned char head[4], *block = malloc(LONGEST);
    stated s = nothing;
    while (block && fread(head, 1, 4, in) == 4 && head[0] == 0xff && head[1] != SOS) {
        unsigned n = big_endian(head + 2, 2);
        if (head[1] == 0xff) { /* fill byte */
            if (fseek(in, -3, SEEK_CUR)) break;
            continue;
        }
        if (n < 2 || fread(block, 1, n - 2, in) != n - 2) break;
        if (head[1] == APP1 && n - 2 > 6 && memcmp(block, "Exif\0\0", 6) == 0) {
            s = from_block(block, n - 2);
            break;
        }
    }
    free(block);
    return s;
}

static stated from_png(FILE *in)
{
    enum { MOST = 1 << 20 };
    unsigned char head[8];
    stated s = nothing;
    while (fread(head, 1, 8, in) == 8) {
        unsigned n = big_endian(head, 4);
        if (memcmp(head + 4, "eXIf", 4) == 0 && n < MOST) {
            unsigned char *block = malloc(n + 6);
            if (block && fread(block + 6, 1, n, in) == n) {
                memcpy(block, "Exif\0\0", 6);
                s = from_block(block, n + 6);
            }
            free(block);
            break;
        }
        if (memcmp(head + 4, "IEND", 4) == 0 || n > INT32_MAX || fseek(in, (long)n + 4, SEEK_CUR)) break;
    }
    return s;
}

/* ---- libtiff ---------------------------------------------------------------------------------------------
 */

static double first_of(const void *data, TIFFDataType type)
{
    float f;
    double d;
    uint16_t h;
    uint32_t l;
    switch (type) {
    case TIFF_RATIONAL:
    case TIFF_SRATIONAL:
    case TIFF_FLOAT: memcpy(&f, data, sizeof f); return (double)f;
    case TIFF_DOUBLE: memcpy(&d, data, sizeof d); return d;
    case TIFF_SHORT: memcpy(&h, data, sizeof h); return h;
    case TIFF_LONG: memcpy(&l, data, sizeof l); return l;
    default: return NAN;
    }
}

/* A tag of the current directory, whatever libtiff gives it as. */
static double tiff_number(TIFF *t, uint32_t tag)
{
    const TIFFField *field = TIFFFieldWithTag(t, tag);
    if (!field) return NAN;
    TIFFDataType type = TIFFFieldDataType(field);
    if (TIFFFieldPassCount(field)) {
        uint16_t few = 0;
        uint32_t many = 0;
        void *data = NULL;
        int wide = TIFFFieldReadCount(field) == TIFF_VARIABLE2;
        int ok = wide ? TIFFGetField(t, tag, &many, &data) : TIFFGetField(t, tag, &few, &data);
        return ok && data && (wide ? many : few) > 0 ? first_of(data, type) : NAN;
    }
    union {
        float f;
        double d;
        uint16_t h;
        uint32_t l;
    } v = {.d = 0};
    if (TIFFFieldReadCount(field) != 1 || !TIFFGetField(t, tag, &v)) return NAN;
    if ((type == TIFF_RATIONAL || type == TIFF_SRATIONAL) &&
        TIFFFieldSetGetSize(field) == (int)sizeof(double))
        return v.d;
    return first_of(&v, type);
}

static void tiff_directory(stated *s, TIFF *t)
{
    double *const to[] = {&s->time, &s->shutter_apex, &s->f_number,    &s->aperture_apex, &s->iso,
                          &s->type, &s->standard,     &s->recommended, &s->speed};
    static const uint32_t tags[] = {33434, 37377, 33437, 37378, 34855, 34864, 34865, 34866, 34867};
    for (size_t i = 0; i < sizeof tags / sizeof *tags; i++)
        if (isnan(*to[i])) *to[i] = tiff_number(t, tags[i]);
}

static stated from_tiff(const char *path)
{
    stated s = nothing;
    toff_t at = 0;
    TIFFSetErrorHandler(NULL);
    TIFFSetWarningHandler(NULL);
    TIFF *t = TIFFOpen(path, "r");
    if (!t) return s;
    int has = TIFFGetField(t, TIFFTAG_EXIFIFD, &at);
    tiff_directory(&s, t); /* TIFF/EP has them here; EXIF's own directory counts more */
    if (has) {
        stated own = nothing;
        if (TIFFReadEXIFDirectory(t, at)) tiff_directory(&own, t);
        double *a = (double *)&own, *b = (double *)&s;
        for (size_t i = 0; i < sizeof s / sizeof(double); i++) b[i] = isnan(a[i]) ? b[i] : a[i];
    }
    TIFFClose(t);
    return s;
}

exif_facts exif_read(const char *path)
{
    stated s = nothing;
    unsigned char head[8] = {0};
    FILE *in = fopen(path, "rb");
    if (!in) return settle(&s);
    size_t n = fread(head, 1, sizeof head, in);
    if (n == 8 && memcmp(head, "\x89PNG\r\n\x1a\n", 8) == 0) s = from_png(in);
    else if (n >= 4 && head[0] == 0xff && head[1] == 0xd8 && fseek(in, 2, SEEK_SET) == 0) s = from_jpeg(in);
    fclose(in);
    if (n >= 4 && (memcmp(head, "II*\0", 4) == 0 || memcmp(head, "MM\0*", 4) == 0 ||
                   memcmp(head, "II+\0", 4) == 0 || memcmp(head, "MM\0+", 4) == 0))
        s = from_tiff(path);
    return settle(&s);
}
