/*
 * choose.h - which hypothesis a lamp gets.
 */
#ifndef CHOOSE_H
#define CHOOSE_H

#include "analysis.h"
#include "pictures.h"

/* 1 if something hides or shapes the lamp: hypotheses will be asked, and need pictures. */
int choose_needed(const lamp *l, const lightfield *f);

/* Set best, interpolation and fate (TAKEN or UNEXPLAINED), and the lamp's masks.  f: the residual, all lamps
 * out. */
int choose_model(found *it, const lightfield *f, const pictures *pics, errmsg *e);

#endif
