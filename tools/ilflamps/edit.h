/*
 * edit.h - lamps made brighter, of another colour, or put out.
 */
#ifndef EDIT_H
#define EDIT_H

#include "analysis.h"

/* "K.gain=X", "K.rgb=R,G,B" (radiance), "K.off"; K counts the lamps as the report lists them, from 1. */
int edit_lamp(analysis *a, const char *edit, errmsg *e);

#endif
