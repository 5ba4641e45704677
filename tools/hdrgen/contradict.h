/*
 * contradict.h - samples that contradict each other: found before anything is learnt from them, and what
 * they say of the series as a whole.  Pure.
 */
#ifndef HDRGEN_CONTRADICT_H
#define HDRGEN_CONTRADICT_H

#include "base/errmsg.h"
#include "noise.h"
#include "response.h"
#include "samples.h"

/* Set s->out where two neighbouring exposures of a pixel differ by more than noise and what this series
 * usually shows:
 * something moved there.  r: any fair estimate of the response; lnt[k] = ln t_k, rising with k. */
int contradict_mark(samples *s, const response *r, const noise_model *noise, const double *lnt, errmsg *e);

typedef enum contradict_cause {
    CAUSE_UNKNOWN,
    CAUSE_CAMERA,   /* worse where the picture has edges */
    CAUSE_REGION,   /* most of it lies in few places */
    CAUSE_EXPOSURE, /* one exposure is off by a factor */
    CAUSE_CURVE     /* no one curve fits: other settings, tone mapping, wrong times */
} contradict_cause;

typedef struct contradict_facts {
    double stops; /* rms difference of neighbouring exposures beyond noise, log2; differences count up to 2 */
    double usual; /* deviation of a normal distribution with the differences' median, ln */
    double share; /* part of the pixels whose exposures differ by more than a quarter stop beyond noise */
    int pairs;    /* of samples that were compared; 0: nothing is known */
    contradict_cause cause;
    int exposure; /* CAUSE_EXPOSURE: which one, and by how many stops it is too bright for its time */
    double off;
} contradict_facts;

/* More than cameras on a tripod and scenes at rest show. */
int contradict_matters(const contradict_facts *f);

/* Response and noise as they came out. */
int contradict_measure(contradict_facts *f, const samples *s, const response *r, const noise_model *noise,
                       const double *lnt, errmsg *e);

#endif
