/*
 * exif.c - see exif.h.  Exif 2.3: ExposureTime 0x829A (else APEX ShutterSpeedValue 0x9201, t = 2^-Tv),
 * FNumber 0x829D, PhotographicSensitivity 0x8827.
 */
#include "exif.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <libexif/exif-data.h>
#include <tiffio.h>

static double plausible(double v)
{
    return isfinite(v) && v > 0 && v < 1e9 ? v : 0;
}

static double number(ExifData *d, ExifTag tag)
{
    ExifEntry *x = exif_data_get_entry(d, tag);
    ExifByteOrder order = exif_data_get_byte_order(d);
    if (!x || !x->data || x->components < 1)
        return 0;
    if (x->format == EXIF_FORMAT_RATIONAL && x->size >= 8) {
        ExifRational r = exif_get_rational(x->data, order);
        return r.denominator ? (double)r.numerator / r.denominator : 0;
    }
    if (x->format == EXIF_FORMAT_SRATIONAL && x->size >= 8) {
        ExifSRational r = exif_get_srational(x->data, order);
        return r.denominator ? (double)r.numerator / r.denominator : 0;
    }
    if (x->format == EXIF_FORMAT_SHORT && x->size >= 2)
        return exif_get_short(x->data, order);
    if (x->format == EXIF_FORMAT_LONG && x->size >= 4)
        return exif_get_long(x->data, order);
    return 0;
}

static exif_facts from_jpeg(const char *path)
{
    exif_facts f = {0};
    ExifData *d = exif_data_new_from_file(path);
    if (!d)
        return f;
    f.exposure_s = plausible(number(d, EXIF_TAG_EXPOSURE_TIME));
    if (!(f.exposure_s > 0) && exif_data_get_entry(d, EXIF_TAG_SHUTTER_SPEED_VALUE))
        f.exposure_s = plausible(exp2(-number(d, EXIF_TAG_SHUTTER_SPEED_VALUE)));
    f.f_number = plausible(number(d, EXIF_TAG_FNUMBER));
    f.iso = plausible(number(d, EXIF_TAG_ISO_SPEED_RATINGS));
    exif_data_unref(d);
    return f;
}

static exif_facts from_tiff(const char *path)
{
    exif_facts f = {0};
    toff_t at = 0;
    TIFF *t = TIFFOpen(path, "r");
    if (!t)
        return f;
    if (TIFFGetField(t, TIFFTAG_EXIFIFD, &at) && TIFFReadEXIFDirectory(t, at)) {
        float v = 0;
        uint16_t count = 0;
        void *iso = NULL;
        if (TIFFGetField(t, EXIFTAG_EXPOSURETIME, &v))
            f.exposure_s = plausible(v);
        if (TIFFGetField(t, EXIFTAG_FNUMBER, &v))
            f.f_number = plausible(v);
        if (TIFFGetField(t, EXIFTAG_ISOSPEEDRATINGS, &count, &iso) && count > 0 && iso)
            f.iso = plausible(*(const uint16_t *)iso);
    }
    TIFFClose(t);
    return f;
}

exif_facts exif_read(const char *path)
{
    exif_facts none = {0};
    unsigned char head[4] = {0};
    FILE *in = fopen(path, "rb");
    if (!in)
        return none;
    size_t n = fread(head, 1, sizeof head, in);
    fclose(in);
    if (n == 4 && head[0] == 0xff && head[1] == 0xd8)
        return from_jpeg(path);
    if (n == 4 && (memcmp(head, "II*\0", 4) == 0 || memcmp(head, "MM\0*", 4) == 0)) {
        TIFFSetErrorHandler(NULL);
        TIFFSetWarningHandler(NULL);
        return from_tiff(path);
    }
    return none;
}
