/*
 * falloff.h - brightness falloff of a lens: relative signal V(theta) per channel, V(0) = 1
 * by convention; a picture is corrected by dividing by it (paper, section 4.2 and figure 6).
 *
 * Two kinds of file:
 *
 *   text   lines "DEG R G B" (further columns, such as falloffcal's standard deviations, are
 *          ignored), angles growing, values > 0; or lines "polynomial DOMAIN c0 c1 c2 ..." (one for all
 *          channels or one each for R, G, B), DOMAIN one of rn, deg, rad; "#" begins a comment
 *   JSON   an object whose members are sets such as "f5.6": {"2": 0.1755, "4": -0.5286}:
 *          V(rn) = 1 + sum c_k rn^k (power "0" replaces the 1); other members are remarks
 *
 * rn = theta / half: the radius relative to the image circle after a remap to equidistant.
 */
#ifndef FALLOFF_H
#define FALLOFF_H

#include "base/errmsg.h"
#include "chart.h"

#define FALLOFF_STEPS 2048

typedef struct falloff {
    double half;                    /* field angle of the last entry */
    char chosen[64];                /* set taken from several without being asked for, or "" */
    double v[3][FALLOFF_STEPS + 1]; /* V at angle half*k/FALLOFF_STEPS, > 0 */
} falloff;

/* Read a file; half = half the field of view.  set picks one of a JSON file's sets by name, or NULL:
 * then f_number picks "f<number>", or if that is 0 (unknown) the first set counts, and is named in
 * `chosen` if there are more. */
int falloff_read(falloff *f, const char *path, double half, const char *set, double f_number, errmsg *e);

/* The same from text in memory (name for messages). */
int falloff_parse(falloff *f, const char *text, const char *name, double half, const char *set,
                  double f_number, errmsg *e);

double falloff_at(const falloff *f, int channel, double theta);

/* Divide a picture (channels 1..4, alpha untouched; grey takes the mean curve) by the curve at each
 * pixel's angle.  c is the disc that the picture is. */
void falloff_apply(float *pix, int channels, const chart *c, const falloff *f);

#endif
