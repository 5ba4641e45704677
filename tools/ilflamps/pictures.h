/*
 * pictures.h - what stands in front of the walls in each probe's picture.
 */
#ifndef PICTURES_H
#define PICTURES_H

#include "lamp.h"
#include "surroundings.h"

typedef struct pictures {
    int nt, np;
    float *opacity; /* per probe and texel: part of it that something hides from the walls, 0 to 1; below 0:
                       it doesn't tell, as the wall is as dark as what hides */
    double dark;    /* luminance of what hides over the wall's */
    const surroundings *around;
} pictures;

/* The walls' luminance at a texel is the median of what other probes see at the place that the texel shows.
 */
int pictures_make(pictures *p, const lightfield *f, const surroundings *around, errmsg *e);
/* Where a lamp shone, its own light says how much of it was hidden. */
void pictures_add_lamp(pictures *p, const lamp *l, const lightfield *f);

void pictures_free(pictures *p);

/* Opacity bilinear between the texels that tell; below 0: they don't. */
double pictures_look(const pictures *p, int probe, double x, double y);

#endif
