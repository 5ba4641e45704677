/*
 * depthmap.h - how far what a picture shows is, as seen from its place.
 *
 * Distances run along the ray, in the scene's unit, as their inverses ("nearness"): parallax is linear in them, walls
 * are linear in the direction, and what is very far is 0.  Maps are coarser than pictures: w x h cells over the
 * picture's own axes, laid out as a picture is.
 */
#ifndef DEPTHMAP_H
#define DEPTHMAP_H

#include "views.h"

enum { MOST_SOURCES = 16 };

typedef enum depth_from {
    DEPTH_SWEPT, /* from parallax, by itself */
    DEPTH_BOX    /* the room's box explains what is seen as well */
} depth_from;

typedef struct depthmap {
    int view; /* number of the picture */
    int w, h;
    float *near;              /* w*h: 1/distance */
    float *free;              /* w*h: the same without the box */
    float *sure;              /* w*h: 0 to 1: how likely the distance is right to a tenth */
    float *error;             /* w*h: standard error of the nearness */
    unsigned char *from;      /* w*h: depth_from */
    int source[MOST_SOURCES]; /* pictures that it was compared with */
    int sources;
    double fit; /* median difference of features where depth is as found */
} depthmap;

typedef struct sweep_plan {
    int w, h;        /* cells of a map */
    int levels;      /* hypotheses a cell: nearness 0 to most, evenly */
    double most;     /* nearness of the nearest */
    const int *held; /* per picture: 1: it is no source and no part of the surface; it judges */
} sweep_plan;

/* Choose a plan's numbers; near: the least distance looked for, 0: from the positions; width: columns of a map, 0: from
 * the pictures. */
void sweep_plan_make(sweep_plan *p, const views *s, double near, int width);

int depthmap_make(depthmap *m, int number, const sweep_plan *p, errmsg *e);
void depthmap_free(depthmap *m);

/* Direction of a cell's middle (working coordinates). */
void depthmap_direction(double d[3], const depthmap *m, const views *s, int x, int y);

/* The cell that shows direction d, or -1. */
int depthmap_cell(const depthmap *m, const views *s, const double d[3]);

/* Nearness in direction d (any length), between cells where they show one thing; below 0 where the map ends. */
double depthmap_look(const depthmap *m, const float *near, const views *s, const double d[3]);

/* Sweep spheres round the map's place: near, free, error, sure and sources are filled. */
int depthmap_sweep(depthmap *m, const views *s, const sweep_plan *p, errmsg *e);

#endif
