/*
 * envelope.h - non-negative mixtures that lie on the lower envelope of values: what is seen at a dark place
 * is at least what is scattered there.  Pure.
 */
#ifndef HDRGEN_ENVELOPE_H
#define HDRGEN_ENVELOPE_H

enum { ENVELOPE_MOST = 24 }; /* unknowns */

/* Places, and what each unknown would put there when it is 1: a[i * unknowns + j], all >= 0; value[i] > 0 is
 * what is seen.  bound[i]: the value is no more than a bound from above. */
typedef struct envelope {
    int places, unknowns;
    const double *a, *value;
    const unsigned char *bound;
} envelope;

/* Fill x[unknowns], all >= 0, so that the sum over j of a x hardly exceeds any value, and lies on as many of
 * the lowest as it can: least squares of 1 - sum/value over the places for which use[] isn't 0 (NULL: all),
 * where excess weighs most, values near the sum little and those far above it next to nothing.  may[j]:
 * unknown j may be above 0 (NULL: all). */
void envelope_fit(double *x, const envelope *p, const unsigned char *use, const unsigned char *may);

/* Do values pile up on the sum, as they do where something is added to a dark scene?  ln of the likelihood
 * that a part of the places (whichever suits best) lies on the sum but for noise and the others at any factor
 * above it, over that of all at any factor.  A sum that nothing lies on gains nothing, wherever it is. */
double envelope_pile_up(const envelope *p, const double *x);

/* What a curve with one free factor says at some places. */
typedef struct envelope_scale {
    double factor; /* of the curve, by the same rule; the rest of the sum is held */
    int on;        /* places where the sum is what is seen, within 15 %, and the curve makes most of it */
    double share;  /* those, of the places where the curve is more than 0.3 of what is seen */
} envelope_scale;

/* curve, rest: [places], what is scaled and what is not. */
envelope_scale envelope_rescale(const envelope *p, const double *curve, const double *rest,
                                const unsigned char *use);

#endif
