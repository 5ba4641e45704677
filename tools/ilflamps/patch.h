/*
 * patch.h - the texels of a probe at and round a lamp, and what part of each the lamp covers.
 */
#ifndef PATCH_H
#define PATCH_H

#include "ilf_luminaire.h"
#include "lightfield.h"

typedef struct patch {
    int probe, n;
    int *at;                     /* texels: y*nt + x */
    double *lum;                 /* their luminance less the ring's */
    double *sr;                  /* solid angles */
    double *cover;               /* part covered by the lamp, by patch_cover */
    double *gain;                /* cover is multiplied by it: a lens' own picture; NULL: even */
    const ilf_luminaire *behind; /* its masks hide parts of the lamp: cover counts what they let through;
                                    NULL: none */
    double ring[3];              /* R G B of what surrounds the lamp */
    double ring_lum;
} patch;

/* Texels within `cone` + `margin` texels of the direction from the probe to the lamp's centre; the ring
 * lies 1.5 to 3.5 texels outside `cone`.  Bright texels (over `limit`) are none of the ring.  Returns -1
 * without memory; n = 0 below the horizon, and where the picture did not see all of those texels. */
int patch_make(patch *p, const lightfield *f, int probe, const double centre[3], double cone, double margin,
               double limit);
void patch_free(patch *p);

/* Fill in cover by S x S rays a texel. */
void patch_cover(patch *p, const lightfield *f, const ilf_luminaire *l, int S);

/* Largest side of a texel in a direction, radians. */
double patch_texel(const lightfield *f, const double d[3]);

#endif
