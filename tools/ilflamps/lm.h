/*
 * lm.h - least squares in a few unknowns (Levenberg-Marquardt, derivatives by differences).
 */
#ifndef LM_H
#define LM_H

enum { LM_MOST = 9 };

/* Residuals r[0..m-1] for parameters p. */
typedef void lm_fn(double *r, const double *p, void *context);

/* Improve p[0..n-1] from where they are; step: of the differences.  Returns the sum of squares, or -1 without
 * memory. */
double lm_fit(double *p, int n, int m, lm_fn *fn, void *context, const double *step, int rounds);

#endif
