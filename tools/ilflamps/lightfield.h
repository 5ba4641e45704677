/*
 * lightfield.h - a light field in memory, its directions, and its luminance anywhere.
 *
 * Coordinates are the field's own (x along u, y along v, z along n, from probe (0, 0), scene's unit).
 * Pictures have continuous texel coordinates: (0, 0) the corner at azimuth -pi and the pole, centres at +1/2.
 * Luminance is Radiance's without the 179 lm/W.
 */
#ifndef LIGHTFIELD_H
#define LIGHTFIELD_H

#include <stddef.h>

#include "base/errmsg.h"
#include "ilf.h"

typedef struct lightfield {
    int nu, nv, n; /* probes; probe (i, j) has number j*nu + i; where they stand freely: n, 1, n */
    int free;      /* they stand anywhere: neighbours in number are none in space */
    int nt, np;    /* texels of one: columns (azimuth), rows (polar angle) */
    double dt, dp; /* steps of azimuth and polar angle, radians */
    double polar_max;
    double len_u, len_v, size; /* edges of the sampled rectangle; size: the longer one */
    double (*pos)[3];          /* n places of probes */
    double (*turn)[9]; /* n frames of pictures: their own x, y, z axes in the field's coordinates; NULL: all
                          stand as the field does */
    float *rgb;        /* n*np*nt*3: what is left as lamps are taken out */
    unsigned char
        *unseen; /* n*np*nt: 1 where a picture did not look, and its texel is made up; NULL: nowhere */
    double blur; /* the pictures' own: standard deviation in each of two angles, radians; 0: none (blur.h) */
    ilf_frame frame; /* as the file has it */
    ilf_info info;
} lightfield;

/* Read all of a field's texels.  *f is the caller's until lf_free. */
int lf_read(lightfield *f, const char *path, errmsg *e);
void lf_free(lightfield *f);

/* The field's grid and plane as a file to be written: float, zip. */
ilf_spec lf_spec(const lightfield *f);

/* Write its texels after a spec that has its sizes; path is written in place. */
int lf_write_as(const lightfield *f, const char *path, const ilf_spec *spec, errmsg *e);

/* Write it as version 1, texels float; path is written in place. */
int lf_write(const lightfield *f, const char *path, const char *comments, errmsg *e);

static inline float *lf_texel(const lightfield *f, int probe, int x, int y)
{
    return f->rgb + (((size_t)probe * (size_t)f->np + (size_t)y) * (size_t)f->nt + (size_t)x) * 3;
}

static inline double lf_lum(const lightfield *f, int probe, int x, int y)
{
    return ilf_luminance(lf_texel(f, probe, x, y));
}

/* Probe number for directions that are no probe's, but the field's own. */
enum { LF_FIELD = -1 };

/* Direction of a point in a probe's map, and back. */
void lf_direction(double d[3], const lightfield *f, int probe, double x, double y);
void lf_place(double *x, double *y, const lightfield *f, int probe, const double d[3]);

/* Are probes a and b neighbours?  In a grid: side by side; where they stand freely: no third one stands
 * within the circle between them. */
int lf_neighbours(const lightfield *f, int a, int b);

/* From a picture's own axes to the field's, and back. */
void lf_outward(double d[3], const lightfield *f, int probe);
void lf_inward(double d[3], const lightfield *f, int probe);

/* The texel (y*nt + x) of the field's own map that a probe's texel shows. */
int lf_common(const lightfield *f, int probe, int texel);

/* Solid angle of a texel of row y. */
double lf_texel_sr(const lightfield *f, int y);

/* The texel beside (x, y), over the seam and the pole; 0 if there is none (below the last row). */
int lf_beside(int *x, int *y, const lightfield *f, int dx, int dy);

/* Luminance bilinear between texels, at the map's place (x, y). */
double lf_look(const lightfield *f, int probe, double x, double y);

#endif
