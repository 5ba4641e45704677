/*
 * falloff_fit.h - one smooth curve through falloff readings.  Pure.
 *
 * The logarithm g of the relative signal on a grid of angles over the whole field minimises
 *     sum_i (log y_i - g(theta_i))^2 + lambda sum_k w_k (third difference of g)_k^2,
 * with g even about the axis, so that what the data don't say continues as a + b theta^2.  lambda and how w
 * falls towards the rim are averaged over by their marginal likelihood: the standard deviations are meant to
 * hold.  g(theta_i) is the mean over the angles that the source covers.  Outliers are judged by
 * falloff_outliers.h.  The signal may not grow with the angle, unless the readings prove a rise by three
 * standard deviations.  Positive by construction.
 */
#ifndef FALLOFF_FIT_H
#define FALLOFF_FIT_H

#include "base/errmsg.h"

#define FIT_NODES 49

typedef struct falloff_reading {
    double theta;  /* radians; the mean angle of what the reading is the mean of */
    double spread; /* and the standard deviation of those angles, 0: a point */
    double y[3];   /* signal per channel; not positive: not used */
    double sd[3];  /* its relative standard deviation as measured, 0 unknown */
    int used[3];   /* out: 0 where the fit took it for an outlier */
} falloff_reading;

typedef struct falloff_curve {
    double half;          /* radians */
    double v[FIT_NODES];  /* signal relative to the axis at half*k/(FIT_NODES-1) */
    double sd[FIT_NODES]; /* its standard deviation, relative to v */
    double axis;          /* the signal on the axis, unit of y */
    double scatter;       /* relative standard deviation of a reading about the curve */
    double freedom;       /* effective number of parameters */
    double rises_to;      /* radians; up to here a rise is proven and kept, 0: none */
    int used;             /* readings that count */
} falloff_curve;

/* Fit channel c of n readings over [0, half].  Fails with fewer than 2 usable readings. */
int falloff_fit(falloff_curve *f, falloff_reading *r, int n, int c, double half, errmsg *e);

/* Curve between nodes, cubic. */
double falloff_curve_at(const falloff_curve *f, double theta, double *sd);

#endif
