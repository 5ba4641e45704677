/*
 * remapjob.h - a picture's pixels to the output's, by weights that pictures of one geometry share.
 */
#ifndef REMAPJOB_H
#define REMAPJOB_H

#include "base/errmsg.h"
#include "chart.h"
#include "image/image.h"
#include "outcome.h"
#include "settings.h"

/* What pictures of one geometry share: weights are made once.  Zero to begin with. */
typedef struct session {
    int several; /* more than one picture will come: keep the plan */
    chart src, dst;
    struct remap_plan *plan;
} session;
void session_free(session *w);

/* A picture that input_load() gave, by its chart, into the chart dst.  rgb: dst width*height*3; alpha:
 * width*height.  w: NULL for none. */
int remap_picture(float *rgb, float *alpha, outcome *o, session *w, const settings *s, img *im, int all_good,
                  const chart *src, const chart *dst, errmsg *e);

#endif
