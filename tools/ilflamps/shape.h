/*
 * shape.h - what a lamp looks like: the body whose pictures fit its spots best.
 */
#ifndef SHAPE_H
#define SHAPE_H

#include "centres.h"
#include "ilf_luminaire.h"
#include "patch.h"

typedef struct shape {
    ilf_luminaire l;       /* without masks; rgb set */
    double radiance;       /* luminance of rgb */
    double misfit;         /* rms of texels' misfit over their rms, over the probes that see all of it */
    int full;              /* probes that see all of it */
    double sigma_radiance; /* relative standard error */
    double sigma_position; /* standard error of the middle, scene's unit; 0: not known */
    int lens;              /* its radiance depends on the direction; radiance is the largest (gradient.h) */
} shape;

/* Fit lamp number `number`.  Returns 0; 1 where it can't be told (too few probes see it whole); -1 without
 * memory. */
int shape_fit(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f, double limit);

/* The same as a ball that pictures show blurred (f->blur): by all probes that see about all of it. */
int shape_fit_ball(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f,
                   double limit);

/* Fit its body to patches that bring their own gain, lying about `at` with covariance cov (cov NULL: go on
 * from s->l).  Sets l but its radiance, misfit, full.  Returns 0, or -1 without memory. */
int shape_fit_lens(shape *s, const double at[3], const double cov[3][3], patch *p, int n,
                   const lightfield *f);

/* Fit the body of a lamp anew, from s->l on: now what hides it is known (s->l's masks), the probes that see
 * part of it (`seen`, per probe) have their say.  Sets s->l's body and radiance, misfit.  0; 1 where nothing
 * can be told; -1 without memory. */
int shape_fit_behind(shape *s, const double *seen, const lightfield *f, double limit);

#endif
