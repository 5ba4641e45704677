/*
 * sensor.h - what a camera raw file says of its sensor, and the sensor's own values.
 *
 * A value is the file's number less the black level of its photosite, in the file's unit, so that values are
 * proportional to light up to `clip`.  No white balance, no colour matrix, nothing interpolated: these belong
 * after the merge, where a channel that is clipped can no longer leak into the others.
 */
#ifndef HDRGEN_SENSOR_H
#define HDRGEN_SENSOR_H

#include <stdint.h>

#include "base/errmsg.h"
#include "cfa.h"

enum { SENSOR_CLIPPED = 65535 }; /* value of a photosite at or above its white level */

typedef struct sensor_facts {
    int width, height;   /* the part that sees light, as it lies on the chip (not turned) */
    int channels;        /* values per pixel: 1 (mosaic or grey) or 3 */
    cfa mosaic;          /* columns 0: none */
    int orientation;     /* EXIF's 1..8: how it is to be turned for looking at */
    double aspect;       /* width of a pixel over its height */
    double balance[3];   /* multipliers of the camera's white balance as shot, least 1; 0: not stated */
    double daylight[3];  /* those that make daylight grey by the matrix; 0: unknown */
    double matrix[3][3]; /* balanced sensor values to linear sRGB (BT.709), rows add up to 1 */
    int has_matrix;
    char camera[132];
    double exposure_s, f_number, iso; /* 0: not stated */
    /* set by sensor_read: some makers' black and white levels stand among the pixels */
    int black[3], clip[3]; /* black level (least of the photosites); white less black, by colour */
} sensor_facts;

/* The header.  Sensors whose values can't be merged one by one (four colours, chips set at 45 degrees, pixels
 * that are not square) are refused in words. */
int sensor_probe(sensor_facts *f, const char *path, errmsg *e);

/* The values, width*height*channels, malloc'd; black and clip of f are set.  The file must still be as
 * probed. Damaged files are refused. */
int sensor_read(uint16_t **values, sensor_facts *f, const char *path, errmsg *e);

#endif
