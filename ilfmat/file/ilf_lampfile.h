/*
 * ilf_lampfile.h - lamps in files of version 2 (docs/FORMAT.md, sections 1.8 and 1.9): as rows of numbers in
 * two attributes, pictures of masks and the lamps' measured shares as further parts.
 */
#ifndef ILF_LAMPFILE_H
#define ILF_LAMPFILE_H

#include "ilf_internal.h"

enum {
    ROW_NUMBERS = 24, /* of a lamp, and of a mask */
    MOST_LAMPS = 256,
    MOST_MASKS = 16, /* of a lamp */
    MOST_SIDE = 4096,
    MOST_SHEETS = 256,
    MOST_SAMPLES = 1 << 26 /* of all pictures and measured shares of a file */
};

#define LAMPS_ATTRIBUTE "ilf:lamps"
#define MASKS_ATTRIBUTE "ilf:masks"
#define MASK_PART       "mask.%d" /* number of the mask among those of all lamps, from 1 */
#define MASK_CHANNEL    "Y"
#define MEASURED_PART   "measured"
#define LAMP_CHANNEL    "lamp.%d" /* from 1 */

/* A row and the value that it stands for.  What the lamp's shape or the mask's kind doesn't use is 0 in the
 * row. Pointers are left NULL. */
void ilf_lamp_to_row(float row[ROW_NUMBERS], const ilf_luminaire *lamp);
void ilf_mask_to_row(float row[ROW_NUMBERS], const ilf_mask *mask);
void ilf_lamp_from_row(ilf_luminaire *lamp, const float row[ROW_NUMBERS]);
void ilf_mask_from_row(ilf_mask *mask, const float row[ROW_NUMBERS]);

/* What a row must hold; number counts from 1; fails with `status`. */
ilf_status ilf_check_lamp_row(const float row[ROW_NUMBERS], int number, const char *path, ilf_status status,
                              ilf_error *err);
ilf_status ilf_check_mask_row(const float row[ROW_NUMBERS], int number, const char *path, ilf_status status,
                              ilf_error *err);

/* Samples of a mask's picture; 0: its kind has none. */
int64_t ilf_mask_samples(const ilf_mask *mask);

/* All that is to be known of lamps before they are kept: samples finite, and no lamp brighter than a float
 * holds. probes: length of `seen`. */
ilf_status ilf_check_lamp_values(const ilf_luminaire *lamps, int n, int64_t probes, const char *path,
                                 ilf_status status, ilf_error *err);

/* All of the above, and that they are not too many. */
ilf_status ilf_check_lamps(const ilf_luminaire *lamps, int n, int64_t probes, const char *path,
                           ilf_error *err);

/* Read the lamps of a file of version 2 into f->lamps; they are freed with ilf_free_lamps. */
ilf_status ilf_read_lamps(ilf *f, ilf_error *err);
void ilf_free_lamps(ilf_luminaire *lamps, int n);

/* Declare what a file needs for its lamps, in its header; the first further part for them will have the
 * number of parts so far. */
exr_result_t ilf_declare_lamps(exr_context_t file, const ilf_spec *spec, const exr_attr_box2i_t *display);
/* Write these parts, of which the first has number `part`; all before them are written. */
exr_result_t ilf_write_lamps(exr_context_t file, const ilf_spec *spec, int part);

/* An attribute of the first part; *attr is NULL where an optional one is missing (ilf_file.c). */
ilf_status ilf_attribute(const ilf *f, const char *name, exr_attribute_type_t type, const char *type_name,
                         int optional, const exr_attribute_t **attr, ilf_error *err);

#endif
