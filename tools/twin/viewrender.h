/*
 * viewrender.h - what the virtual camera's lens sees, as radiance, by rtrace.
 *
 * Why rtrace and not rpict: every lens takes the same way, and the values come as floats. An rpict
 * picture carries 8-bit mantissas under a shared exponent, up to 0.4 % off and far more in the weak channels
 * of a coloured lamp, which would be taken for errors of the chain under test.
 *
 * Each pixel is the mean over K x K jittered rays; where the brightness range around a pixel stands
 * out (a lamp's edge, a lamp smaller than a pixel) it is taken again with R x R.  Small lamps are the
 * illumination later on: their energy has to be right.
 */
#ifndef VIEWRENDER_H
#define VIEWRENDER_H

#include "stagectl/argwords.h"
#include "stagectl/fisheye.h"

typedef struct view_settings {
    const char *rtrace; /* program */
    const char *octree;
    const argwords *options; /* further arguments for rtrace */
    int supersample, refine; /* K; R, 0 = no refinement */
    int processes;           /* rtrace -n */
} view_settings;

/* radiance: size*size*3, out, W/(sr m2), finite; 0 outside the image circle.  Returns 0 or -1. */
int view_render(float *radiance, const fisheye *f, const camera_frame *c, const view_settings *s, errmsg *e);

/* Refuse options that would change what goes in and comes out of rtrace. */
int view_check_options(const argwords *options, errmsg *e);

/* Key of a rendering: everything that its values depend on, files by their contents. */
int view_key(char hex[65], const fisheye *f, const camera_frame *c, const view_settings *s, errmsg *e);

/* Radiance maps in a cache folder (portable float map).  view_cached: 1 found, 0 not there, -1 failed. */
int view_cached(float *radiance, int size, const char *dir, const char *key, errmsg *e);
int view_store(const float *radiance, int size, const char *dir, const char *key, errmsg *e);

#endif
