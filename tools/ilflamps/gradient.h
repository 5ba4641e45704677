/*
 * gradient.h - wide lamps whose face is not even: a lens before a spotlight, say, whose radiance depends on
 * the direction alone.
 */
#ifndef GRADIENT_H
#define GRADIENT_H

#include "model.h"
#include "pictures.h"

/* Fit lamp number `number` as a lens: centre, shape and radiance (the lens' largest).  Returns 0; 1 where it
 * is no lens, and *s is untouched; -1 without memory. */
int gradient_fit(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f,
                 double limit);

/* A mask (smooth.h): the lens' picture over directions, as the probes saw it.  Of lenses only. */
int gradient_mask(model *m, const lamp *l, const lightfield *f, const pictures *pics);

#endif
