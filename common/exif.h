/*
 * exif.h - exposure facts that a picture file states about itself.
 */
#ifndef HDRGEN_EXIF_H
#define HDRGEN_EXIF_H

typedef struct exif_facts {
    double exposure_s, f_number, iso; /* 0: not stated */
} exif_facts;

/* JPEG by libexif, TIFF by libtiff's EXIF directory.  Never fails: what can't be read is 0. */
exif_facts exif_read(const char *path);

#endif
