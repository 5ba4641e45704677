/*
 * card.h - a rectangle anywhere in space that hides a lamp: what a sheet's outline mostly is.
 */
#ifndef CARD_H
#define CARD_H

#include "outline.h"

/* Append a rectangle's mask to all five versions of m, beginning at an outline, and judge it.  0; 1 where it
 * is no rectangle; -1 without memory. */
int card_fit(model *m, const lamp *l, const lightfield *f, const outline *from);

#endif
