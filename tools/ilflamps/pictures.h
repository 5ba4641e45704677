/*
 * pictures.h - what stands in front of the walls in each probe's picture.
 */
#ifndef PICTURES_H
#define PICTURES_H

#include "lamp.h"
#include "surroundings.h"

typedef struct pictures {
    int nt, np;
    float *opacity; /* per probe and texel: part of it that something hides from the walls, 0 to 1 */
    double dark;    /* luminance of what hides over the wall's */
    const surroundings *around;
} pictures;

/* The walls' luminance at a texel is the median of what other probes see at the place that the texel shows.
 */
int pictures_make(pictures *p, const lightfield *f, const surroundings *around, errmsg *e);
/* Where a lamp shone, its own light says how much of it was hidden. */
void pictures_add_lamp(pictures *p, const lamp *l, const lightfield *f);

void pictures_free(pictures *p);

static inline double pictures_look(const pictures *p, int probe, double x, double y)
{
    const float *o = p->opacity + (size_t)probe * (size_t)(p->np * p->nt);
    int i = (int)(x + (double)p->nt - .5), j = (int)(y - .5);
    const double a = x + (double)p->nt - .5 - i;
    double b = y - .5 - j;

    if (y < .5) j = 0, b = 0;
    if (j >= p->np - 1) j = p->np - 2, b = 1;
    i %= p->nt;
    const int k = (i + 1) % p->nt;
    return (1 - b) * ((1 - a) * (double)o[j * p->nt + i] + a * (double)o[j * p->nt + k]) +
           b * ((1 - a) * (double)o[(j + 1) * p->nt + i] + a * (double)o[(j + 1) * p->nt + k]);
}

#endif
