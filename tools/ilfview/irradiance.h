/*
 * irradiance.h - light on the plane itself, from above: at the probes from what they hold, at points between
 * them from lamps that were taken out.
 *
 *     E = integral of L(omega) cos(phi) d omega over the hemisphere, of R, G, B
 *
 * Between probes the first part is bilinear (without depth correction that is exact); lamps are sampled, with
 * what hides them, at each point.
 */
#ifndef VIEW_IRRADIANCE_H
#define VIEW_IRRADIANCE_H

#include "ilflamps/lightfield.h"

/* Of probe k of the field. */
void irradiance_probe(double rgb[3], const lightfield *f, int k);

/* The lamps' at nx x ny points spread evenly over the rectangle's corners (middle for 1): nx*ny*3 floats, u
 * fastest.  What a lamp hides of the field is taken off. */
void irradiance_lamps(float *rgb, int nx, int ny, const lightfield *f, const ilf_luminaire *lamps, int n);

#endif
