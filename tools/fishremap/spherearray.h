/*
 * spherearray.h - the job of mirror-sphere arrays.
 */
#ifndef SPHEREARRAY_H
#define SPHEREARRAY_H

#include "base/errmsg.h"
#include "outcome.h"
#include "settings.h"

/* Mirror-sphere array to a light field (or, 1x1 without ".ilf.exr", to a probe). */
int job_array(outcome *o, const settings *s, errmsg *e);

#endif
