/*
 * exif.h - exposure facts that a picture file states about itself.
 */
#ifndef HDRGEN_EXIF_H
#define HDRGEN_EXIF_H

typedef struct exif_facts {
    double exposure_s, f_number, iso; /* 0: not stated, or not a number that can be (0/0, 1/0, 0) */
} exif_facts;

/* JPEG (APP1) and PNG (eXIf) by libexif, TIFF by libtiff, in its EXIF directory or beside the picture.  Never
 * fails: what can't be read is 0. */
exif_facts exif_read(const char *path);

#endif
