/*
 * stated.h - do the exposures that the files state agree with their pixels?  From the samples, before
 * anything is fitted.
 */
#ifndef HDRGEN_STATED_H
#define HDRGEN_STATED_H

#include "base/errmsg.h"
#include "samples.h"

typedef struct stated_facts {
    double span; /* of images that are all of one exposure: stops by which the brightest and the darkest
                    differ */
    int worst;   /* image whose step from the one before it disagrees most; 0: none does */
    double says, shows; /* that step in stops, as stated and as the pixels show it */
} stated_facts;

/* exposure[k] rises with k.  linear: codes are proportional to light, and steps must agree to a quarter of a
 * stop and a tenth; else the curve is unknown (sRGB's is assumed), and only steps that no camera's curve
 * explains count. */
void stated_check(stated_facts *f, const samples *s, const double *exposure, int linear);

#endif
