/*
 * settings.h - what the command line of fishremap says, and the two jobs it can name.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include "chart.h"
#include "circle.h"
#include "image.h"
#include "ilf.h"
#include "sphere.h"

typedef enum outside_mode { OUTSIDE_ALPHA, OUTSIDE_BLACK, OUTSIDE_HOLD } outside_mode;
typedef enum view_kind { VIEW_FISHEYE, VIEW_BALL, VIEW_PROBE, VIEW_LATLONG, VIEW_ANGULAR } view_kind;

typedef struct settings {
    const char *in, *out, *overlay, *report, *mask;
    const char *command; /* for the output's header */
    view_kind from, to;
    const char *lens;
    double fov_deg;      /* 0: the lens file's */
    int out_w, out_h;
    int centre_auto, have_centre;
    double centre[2], radius; /* pixels; radius 0: not given */
    const char *falloff, *falloff_set;
    double aperture;     /* f-number for the falloff's set; 0: the picture's own */
    double polar_max_deg; /* 0: 90 */
    double span_deg;     /* latlong's width */
    double rotate_deg, tilt_deg, tilt_to_deg;
    outside_mode outside;
    double filter_sd;    /* of the texels' Gaussian, in texels; 0: means over their area */
    int half_float;      /* 1 half, 0 float, -1 as it fits */
    /* mirror spheres */
    int nu, nv;          /* 0: no array */
    int corners_auto, ncorners;
    sphere_seen corner[4];
    double camera_distance, diameter; /* same unit; distance 0: infinitely far */
    double reflectance[3];
    double hide_camera_deg;          /* half angle about the sphere-to-camera line that is not used */
    const char *second;              /* another picture of the same ball, or NULL */
    double second_view[5];           /* its X, Y, R, and its camera's tilt and tilt-to, degrees */
    int have_plane;
    double plane[9];
    const char *compression;
    void (*progress)(const char *what, double done, double total); /* or NULL */
} settings;

/* What came out of it, for the caller to print and for --report. */
typedef struct outcome {
    double cx, cy, radius;   /* of the image circle, pixels */
    circle_found circle;     /* how well it was found; r 0: it was given */
    int64_t bad_pixels;      /* NaN, infinite or masked */
    double covered;          /* share of the output's solid angle */
    double cpu_plan_s, cpu_prepare_s, cpu_remap_s; /* plan: only where several pictures share one */
    double pitch, polar_valid_deg, tilt_deg; /* arrays */
    sphere_seen *spheres;    /* arrays: where they are; the caller frees them */
    int nspheres;
    const char *spheres_from; /* "rims": fitted to all of them; "corners": as those say; pitch and tilt follow.  NULL for no array */
    int rims_seen;          /* rims within a pixel of the grid */
    double rims_rms;        /* of the spheres' own rims about it, pixels */
    char remark[512];        /* worth telling, or "" */
} outcome;

/* Load the input as linear radiance with mask and alpha folded in: 4 channels.  all_good: every pixel is finite
 * and has alpha 1. */
int input_load(img *im, int *all_good, const settings *s, errmsg *e);

/* What pictures of one geometry share: weights are made once.  Zero to begin with. */
typedef struct session {
    int several;     /* more than one picture will come: keep the plan */
    chart src, dst;
    struct remap_plan *plan;
} session;
void session_free(session *w);

/* One picture to another. */
int job_picture(outcome *o, session *w, const settings *s, errmsg *e);

/* Mirror-sphere array to a light field (or, 1x1 without ".ilf.exr", to a probe). */
int job_array(outcome *o, const settings *s, errmsg *e);

/* Take the camera's own reflection (within the angle, radians, of the axis) out of a ball's picture. */
void hide_camera(float *pix, int *all_good, const chart *c, double angle);

/* Fill texels with alpha 0 as the mode says; rgb w*h*3.  Hold: the nearest covered texel of the
 * column, upwards first. */
void outside_fill(float *rgb, float *alpha, int w, int h, outside_mode mode);

/* Write the picture; partial: some alpha is below 1. */
int result_write(const settings *s, const float *rgb, const float *alpha, int partial, errmsg *e);

/* CPU time of this thread. */
double cpu_seconds(void);

/* The outcome as JSON. */
int report_write(const char *path, const outcome *o, errmsg *e);

#endif
