/*
 * colour.h - from a camera's balanced sensor values to a space of known primaries.  Pure.
 */
#ifndef HDRGEN_COLOUR_H
#define HDRGEN_COLOUR_H

typedef enum colour_space {
    COLOUR_DEFAULT, /* sRGB's primaries for camera raw; the codes' own for other formats */
    COLOUR_SRGB,    /* linear, primaries and white of ITU-R BT.709 */
    COLOUR_CAMERA,  /* the sensor's own, after white balance */
    COLOUR_XYZ,     /* CIE 1931, white of daylight D65 at Y = 1 */
    COLOUR_ACESCG   /* AP1 primaries, ACES white */
} colour_space;

/* m: balanced sensor values to `space`; camera_to_srgb as sensor_facts.matrix. */
void colour_matrix(double m[3][3], colour_space space, const double camera_to_srgb[3][3]);

/* Red, green, blue, white as x, y each, or NULL where they are unknown. */
const float *colour_chromaticities(colour_space space);
const char *colour_name(colour_space space);

/* Weights of Radiance's luminance (.265 R + .670 G + .065 B of linear sRGB) in `space`; -1 where it can't be
 * known. */
int colour_luminance(double weight[3], colour_space space);

#endif
