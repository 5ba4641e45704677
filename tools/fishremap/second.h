/*
 * second.h - a second view of the same mirror ball, added to the first.
 */
#ifndef SECOND_H
#define SECOND_H

#include "base/errmsg.h"
#include "chart.h"
#include "outcome.h"
#include "settings.h"

/* Add the second view of the ball to rgb and alpha, which the first gave. */
int second_add(float *rgb, float *alpha, outcome *o, const settings *s, const chart *first, const chart *dst,
               errmsg *e);

#endif
