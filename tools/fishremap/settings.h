/*
 * settings.h - what the command line of fishremap says.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include "sphere.h"

/* NONE: not given, until usage_check() (options.h) put the default in its place; numbers that were not given
 * are 0 or NaN until then. */
typedef enum outside_mode { OUTSIDE_NONE = -1, OUTSIDE_ALPHA, OUTSIDE_BLACK, OUTSIDE_HOLD } outside_mode;
typedef enum view_kind {
    VIEW_NONE = -1,
    VIEW_FISHEYE,
    VIEW_BALL,
    VIEW_PROBE,
    VIEW_LATLONG,
    VIEW_ANGULAR
} view_kind;

typedef struct settings {
    const char *in, *out, *overlay, *report, *mask;
    const char *layer;   /* of an OpenEXR input, or NULL */
    const char *command; /* for the output's header */
    view_kind from, to;
    const char *lens, *lens2; /* lens2: of a second circle, or NULL: as lens */
    double fov_deg;           /* 0: the lens file's */
    int out_w, out_h;
    int centre_auto, have_centre;
    double centre[2], radius;                     /* pixels; radius 0: not given */
    const char *falloff, *falloff2, *falloff_set; /* falloff2: of a second circle, or NULL: as falloff */
    double aperture;                              /* f-number for the falloff's set; 0: the picture's own */
    double polar_max_deg;                         /* 0: 90 */
    double span_deg;                              /* latlong's width; 0: the picture's own, or 360 */
    double latitudes[2]; /* latlong's upper and lower edge, degrees; NaN: the picture's own, or 90 and -90 */
    double rotate_deg, tilt_deg, tilt_to_deg;
    double heading_deg; /* NaN: the camera looks along n */
    int have_pose;      /* heading, tilt and rotate come from --pose; 2: as IN states them */
    double pose[3];     /* heading, pitch, roll, degrees */
    double nadir_deg;   /* half angle about straight down that is not used */
    /* two circles in one picture */
    int dual, circles_auto, ncircles; /* ncircles: 2, or 0 for the largest in each half */
    double circle[2][3];              /* X, Y, R */
    double circle_rotate[2];          /* NaN: 0 */
    outside_mode outside;
    double filter_sd; /* of the texels' Gaussian, in texels; 0: means over their area */
    int half_float;   /* 1 half, 0 float, -1 as it fits */
    /* mirror spheres */
    int nu, nv; /* 0: no array */
    int corners_auto, ncorners;
    sphere_seen corner[4];
    double camera_distance, diameter; /* same unit; distance 0: infinitely far */
    double reflectance[3];
    double hide_camera_deg; /* half angle about the sphere-to-camera line that is not used */
    const char *second;     /* another picture of the same ball, or NULL */
    double second_view[6];  /* its X, Y, R, and its camera's tilt, tilt-to and rotate, degrees */
    int second_rotates;     /* 0: as IN */
    const char *second_mask;
    int have_second_gain;
    double second_gain; /* 0: matched over what both show */
    int have_plane;
    double plane[9];
    const char *compression;
    int dry_run;                                                   /* check only */
    void (*progress)(const char *what, double done, double total); /* or NULL */
} settings;

#endif
