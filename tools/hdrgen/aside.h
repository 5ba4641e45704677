/*
 * aside.h - pictures beside the series: the mask of hot pixels and the flat field.
 */
#ifndef HDRGEN_ASIDE_H
#define HDRGEN_ASIDE_H

#include "job.h"

/* On the merged picture as it lies on the sensor, a mosaic still a mosaic. */
int aside_heal(job *j, errmsg *e);    /* opts.hot */
int aside_flatten(job *j, errmsg *e); /* opts.flat */

#endif
