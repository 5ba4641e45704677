/*
 * calibrate.h - maximum-likelihood refinement of response, noise model and exposure times.
 */
#ifndef HDRGEN_CALIBRATE_H
#define HDRGEN_CALIBRATE_H

#include "base/errmsg.h"
#include "noise.h"
#include "response.h"
#include "samples.h"

typedef struct calib_opts {
    int fit_response, fit_noise, fit_times;
    noise_model fixed_noise; /* parameters >= 0 are kept as given */
    double lambda;           /* smoothness; 1 = what real cameras show */
    double time_spread;      /* fit_times: prior standard deviation of ln t */
    int reference;           /* fit_times: the exposure whose time is held */
} calib_opts;

typedef struct calib_facts {
    int pixels[RESPONSE_MAX_CHANNELS]; /* that took part */
    double condition[RESPONSE_MAX_CHANNELS];
    double chi2[RESPONSE_MAX_CHANNELS]; /* mean squared residual over its variance; 1 is right */
    int rounds;
} calib_facts;

/* Improve r, noise[channels] and lnt[exposures] in place as opts says; what is not fitted stays.
 * On failure nothing is changed. */
int calibrate(response *r, noise_model *noise, double *lnt, calib_facts *facts, const samples *s,
              const calib_opts *opts, errmsg *e);

#endif
