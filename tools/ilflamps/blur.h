/*
 * blur.h - pictures that are no sharper than their texels: mirror spheres in a photograph whose pixels are as
 * wide as a texel, lenses out of focus.  A lamp of a texel or two looks like no body there, and all of it
 * shines at its edge.
 */
#ifndef BLUR_H
#define BLUR_H

#include "shape.h"

typedef struct blurred {
    int lamps;            /* that say how blurred the pictures are; 0: they are not, or nothing can be told */
    double width;         /* standard deviation in each of two angles, radians: one for all probes */
    double sharp, misfit; /* rms misfit of the lamps' bodies without it, and with it */
} blurred;

/* How blurred a field's pictures are, from n lamps (use: those that may be asked; c, list: centres.h), if any
 * of them says that they are.  Sets f->blur.  0, or -1 without memory. */
int blur_find(blurred *b, lightfield *f, const unsigned char *use, const centre *c, int n,
              const bloblist *list, double limit);

/* Whether a body of blurred pictures is one: its light is the same in all probes that see it, and it fits. */
int blur_shows(const shape *s);

#endif
