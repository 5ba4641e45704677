/*
 * settings.h - what the command line of fishremap says, and the two jobs it can name.
 */
#ifndef SETTINGS_H
#define SETTINGS_H

#include "chart.h"
#include "circle.h"
#include "ilf.h"
#include "image/image.h"
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
    const char *lens;
    double fov_deg; /* 0: the lens file's */
    int out_w, out_h;
    int centre_auto, have_centre;
    double centre[2], radius; /* pixels; radius 0: not given */
    const char *falloff, *falloff_set;
    double aperture;      /* f-number for the falloff's set; 0: the picture's own */
    double polar_max_deg; /* 0: 90 */
    double span_deg;      /* latlong's width */
    double rotate_deg, tilt_deg, tilt_to_deg;
    double heading_deg; /* NaN: the camera looks along n */
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

/* What came out of it, for the caller to print and for --report. */
typedef struct outcome {
    double cx, cy, radius;                         /* of the image circle, pixels */
    circle_found circle;                           /* how well it was found; r 0: it was given */
    int64_t bad_pixels;                            /* NaN, infinite or masked */
    double covered;                                /* share of the output's solid angle */
    double cpu_plan_s, cpu_prepare_s, cpu_remap_s; /* plan: only where several pictures share one */
    double pitch, polar_valid_deg, tilt_deg;       /* arrays */
    sphere_seen *spheres;                          /* arrays: where they are; the caller frees them */
    int nspheres;
    const char *spheres_from; /* "rims": fitted to all of them; "corners": as those say; pitch and tilt
                                 follow.  NULL for no array */
    int rims_seen;            /* rims within a pixel of the grid */
    double rims_rms;          /* of the spheres' own rims about it, pixels */
    double second_gain, second_residual,
        second_overlap; /* a second view's factor; relative deviation from IN, robust; steradians */
    char remark[1024];  /* worth telling, or "" */
} outcome;

/* Load the input as linear radiance with mask and alpha folded in: 4 channels.  all_good: every pixel is
 * finite and has alpha 1. */
int input_load(img *im, int *all_good, const settings *s, errmsg *e);

/* What pictures of one geometry share: weights are made once.  Zero to begin with. */
typedef struct session {
    int several; /* more than one picture will come: keep the plan */
    chart src, dst;
    struct remap_plan *plan;
} session;
void session_free(session *w);

/* Lens, falloff, mask and second picture: can they be read? */
int job_dry_run(const settings *s, errmsg *e);

/* One picture to another. */
int job_picture(outcome *o, session *w, const settings *s, errmsg *e);

/* Mirror-sphere array to a light field (or, 1x1 without ".ilf.exr", to a probe). */
int job_array(outcome *o, const settings *s, errmsg *e);

/* Take the camera's own reflection (within the angle, radians, of the axis) out of a ball's picture. */
void hide_camera(float *pix, int *all_good, const chart *c, double angle);

/* Fill texels with alpha 0 as the mode says; rgb w*h*3.  Hold: the nearest covered texel of the
 * column, upwards first. */
void outside_fill(float *rgb, float *alpha, int w, int h, outside_mode mode);

/* Write the picture; partial: some alpha is below 1.  view: Radiance's VIEW for a .hdr, or NULL. */
int result_write(const settings *s, const float *rgb, const float *alpha, int partial, const char *view,
                 errmsg *e);

/* Radiance's name for the view that chart c of kind is, after "VIEW=": 0, or -1 where Radiance has none (text
 * is ""). */
int radiance_view(char *text, size_t room, const chart *c, view_kind kind);

/* Add to the remarks. */
void outcome_note(outcome *o, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Take c's camera as the settings turn it (chart.h). */
void turn_chart(chart *c, const settings *s, int mirror);

/* A picture that input_load() gave, by its chart, into the chart dst. */
int remap_picture(float *rgb, float *alpha, outcome *o, session *w, const settings *s, img *im, int all_good,
                  const chart *src, const chart *dst, errmsg *e);

/* Add the second view of the ball to rgb and alpha, which the first gave. */
int second_add(float *rgb, float *alpha, outcome *o, const settings *s, const chart *first, const chart *dst,
               errmsg *e);

/* CPU time of all threads, and of this one. */
double cpu_seconds(void);
double cpu_thread_seconds(void);

/* The outcome as JSON. */
int report_write(const char *path, const outcome *o, errmsg *e);

#endif
