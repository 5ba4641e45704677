/*
 * ball.h - an opaque ball that hides a lamp.
 */
#ifndef BALL_H
#define BALL_H

#include "outline.h"

/* Append a ball to all five versions of m, beginning at a sheet's outline, and judge it; blind: how far the
 * versions part.  0; 1 where it is no ball; -1 without memory. */
int ball_fit(model *m, const lamp *l, const lightfield *f, const outline *from);

#endif
