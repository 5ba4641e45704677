/*
 * sourcedisc.h - the diffuse source in a falloff picture, and flat fields.  Pure.
 */
#ifndef SOURCEDISC_H
#define SOURCEDISC_H

#include "base/errmsg.h"
#include "chart.h"
#include "falloff_fit.h"

typedef struct source_disc {
    double x, y;               /* centroid, pixels */
    double theta;              /* its field angle, radians */
    int pixels;                /* that count: the disc without its border */
    double value[3];           /* robust mean per channel */
    double sd[3];              /* relative standard deviation of that mean */
    double mean_theta, spread; /* mean and standard deviation of its pixels' field angles, radians */
    double top[3],
        at_top[3]; /* its brightest value per channel, and the share of its pixels that have just that */
} source_disc;

/* Find the brightest patch within 12 degrees of field angle theta: pixels above half of its (median-filtered)
 * peak that hang together, without a border of an eighth of its radius; mean without what lies
 * beyond 3 robust standard deviations.  pix: 4 floats a pixel, alpha < 1/2 not used. */
int source_find(source_disc *s, const float *pix, const chart *c, double theta, errmsg *e);

/* A flat field's brightest value, per channel, if so many pixels of the field have just that, and so few one
 * near it, that the picture must be clipped there; else 0.  white: the value of the picture's highest code,
 * 0: it is not coded. */
int flat_clipped(double top[3], const float *pix, const chart *c, double white, errmsg *e);

/* Flat field: median per channel of rings, from the axis to the rim of the field; *n readings (at most
 * max) with the standard deviation of each median. */
int flat_rings(falloff_reading *r, int *n, int max, const float *pix, const chart *c, errmsg *e);

#endif
