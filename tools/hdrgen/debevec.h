/*
 * debevec.h - response recovery from sample pixels, first estimates.
 */
#ifndef HDRGEN_DEBEVEC_H
#define HDRGEN_DEBEVEC_H

#include "base/errmsg.h"
#include "basis.h"
#include "response.h"
#include "samples.h"

typedef struct solve_facts {
    double condition[RESPONSE_MAX_CHANNELS];
    double residual[RESPONSE_MAX_CHANNELS]; /* RMS of ln exposure, weighted */
    int pixels[RESPONSE_MAX_CHANNELS];
} solve_facts;

/* Debevec & Malik (1997): minimise sum w^2 (g(z) - ln E - ln t)^2 + lambda * bending over g and
 * all E, hat weights w, by QR.  lnt[k] = ln t_k.  r is allocated here. */
int debevec_solve(response *r, solve_facts *facts, const samples *s, const double *lnt, double lambda,
                  errmsg *e);

/* Mitsunaga & Nayar (1999): e = polynomial of order <= 8 in z/max with coefficients that sum to
 * 1; the order with the least error is kept, the ratios are the given ones.  r is allocated here. */
int mitsunaga_solve(response *r, solve_facts *facts, const samples *s, const double *lnt, errmsg *e);

#endif
