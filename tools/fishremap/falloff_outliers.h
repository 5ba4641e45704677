/*
 * falloff_outliers.h - which readings of a falloff are wild.  Pure.
 *
 * A reading is judged against what the others predict for its angle, by what those scatter and by how well
 * they know the curve there: a reading between two neighbours that agree is easily found out; the last one at
 * the rim, beyond which there is none, may be where the lens falls off steeply, and only what no lens does
 * convicts it.
 */
#ifndef FALLOFF_OUTLIERS_H
#define FALLOFF_OUTLIERS_H

#include "falloff_fit.h"

#define FIT_LEAST_NOISE                                                                                      \
    1.5e-3 /* what less than a few of these (log units) is off, is no outlier however still the others are   \
            */

/* Readings of one channel in log units. */
typedef struct fit_data {
    int n;
    double (*row)[FIT_NODES];     /* of the curve's nodes */
    double *t, *y, *raw, *spread; /* angle and spread in node units; y: what is fitted */
    int *in;                      /* 0: an outlier */
} fit_data;

/* Sets d->in.  -1: no memory, or no fit. */
int fit_outliers(fit_data *d);

/* falloff_fit.c's answers: the curve at a reading; its variance in units of the noise's; and each reading's
 * deviation from what the others say, in standard deviations and in log units (off), by the law of stiffness
 * that bears it out best.
 */
double fit_predict(const double g[FIT_NODES], const double row[FIT_NODES]);
double fit_variance(const double (*inv)[FIT_NODES], const double row[FIT_NODES]);
int fit_deleted(double *t, double *off, const fit_data *d);

#endif
