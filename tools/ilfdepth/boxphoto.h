/*
 * boxphoto.h - a box fitted to the pictures themselves.
 */
#ifndef BOXPHOTO_H
#define BOXPHOTO_H

#include "box.h"

/* Sides and turn of the box by least squares of features between pictures, from near; errors by fits without a fourth of the maps each. */
int boxphoto_fit(box *b, const depthmap *maps, int n, const views *s, const sweep_plan *p, errmsg *e);

#endif
