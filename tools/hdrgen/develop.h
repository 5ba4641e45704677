/*
 * develop.h - from what was merged (a mosaic, sensor values) to the picture that is written.
 */
#ifndef HDRGEN_DEVELOP_H
#define HDRGEN_DEVELOP_H

#include "job.h"

/* Which of the series' white balances counts, and what there is to say about it; before the merge. */
int develop_settle(job *j, errmsg *e);

/* In place on j's radiance, sigma, count and flags: colours of a mosaic, white balance and matrix of camera
 * raw, the turn that the first image's orientation tag asks for. */
int job_develop(job *j, errmsg *e);

#endif
