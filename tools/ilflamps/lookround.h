/*
 * lookround.h - what is left in the probes, as one picture from one place.
 */
#ifndef LOOKROUND_H
#define LOOKROUND_H

#include "analysis.h"
#include "image/image.h"

/* Where an exported file looks from, and in which unit. */
typedef struct viewpoint {
    double at[3];  /* scene's coordinates */
    double metres; /* in the scene's unit; 0: not known */
} viewpoint;

/* The plane's middle, in the scene's coordinates. */
void look_from_middle(double at[3], const lightfield *f);

/* Direction (scene's coordinates, unit) of a pixel's middle. */
typedef void look_dir(double d[3], int x, int y, const img *im, const ilf_frame *f);

/* Fill a picture with what is left, seen from v->at: by the surroundings' distances where they are known, else as if
 * they were infinitely far away.  residual: the probes as an open file of version 1. */
int look_round(img *im, const ilf *residual, const analysis *a, const viewpoint *v, look_dir *dir, errmsg *e);

/* Rows of the whole sphere that lose nothing of the probes. */
int look_rows(const lightfield *f);

/* A point or a direction of the field in the scene's coordinates. */
void look_to_scene(double x[3], const ilf_frame *f, const double p[3], int point);

#endif
