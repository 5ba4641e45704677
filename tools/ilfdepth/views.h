/*
 * views.h - the pictures that depth comes from: where each stands, which way it is turned, what it shows.
 *
 * Working coordinates: of a light field its own (x along u, y along v, z along n, from probe (0, 0)); of a list of
 * panoramas the scene's.  A picture's own axes are the rows of axis: azimuth 0, azimuth 90 degrees, pole.  Column x
 * of a picture has azimuth -pi + (x + 1/2) 2 pi/nt, row y polar angle (y + 1/2) polar_max/np, as docs/FORMAT.md has it.
 */
#ifndef VIEWS_H
#define VIEWS_H

#include "base/errmsg.h"
#include "ilf.h"

typedef struct view {
    char name[256]; /* a panorama's file, or "probe 3,4" */
    int slot;       /* its place in the grid or the list, from 0 */
    double at[3], axis[3][3];
    int turned;       /* 0: axis is the identity */
    int nt, np;       /* columns, rows */
    double polar_max; /* the pictures end here; beyond it is nothing */
    float *rgb;       /* np*nt*3 */
    int nodes;        /* features, see feature.h: nodes*nodes of four floats */
    float *feature;
} view;

typedef struct views {
    view *v;
    int n;
    int nu, nv;       /* a field's grid; of panoramas 1 and n */
    int mirrored;     /* 1: pictures came with columns from left to right (panoramas), and go out so */
    double centre[3]; /* of the positions */
    double size;      /* the largest distance between two of them */
    double reach;     /* of a field: half its rectangle's diagonal; else half of size */
    int below;        /* 1: pictures show what is below the horizon, too */
    double origin[3],
        axes[3][3]; /* working coordinates in the scene's: origin + x axes[0] + y axes[1] + z axes[2] */
    const ilf_luminaire *lamps; /* that were taken out, owned by file */
    int n_lamps;
    ilf *file; /* of a field, open; else NULL */
} views;

/* Probes of a light field: those of `chosen` ("I,J I,J ...", or how many, spread over the grid; NULL: 64 of more, else all).
 * *s is the caller's until views_free. */
int views_of_field(views *s, const char *path, const char *chosen, errmsg *e);

/* Panoramas named in a list: lines "picture x y z heading [pitch roll]", equirectangular, top row up, middle column forward, columns to the
 * right; heading: of forward, degrees counter-clockwise from +x about +z, then pitch (nose up), then roll (right side
 * down).  Pictures' names are relative to the list's folder. */
int views_of_list(views *s, const char *path, errmsg *e);

/* Is the light field's file as it was opened?  Ask when all that is needed was read. */
int views_unchanged(const views *s, errmsg *e);

void views_free(views *s);

/* A point of working coordinates in the scene. */
void views_to_scene(double x[3], const views *s, const double p[3]);

/* Direction (unit, working coordinates) of the place (x, y) of a picture of nt x np texels of view v. */
void view_direction(double d[3], const view *v, int nt, int np, double x, double y);

#endif
