/*
 * basis.h - the cubic B-spline in which a log response is sought.
 *
 * A response is g(v) = sum_j c_j B_j(v), v = ln z, z the code, g = ln(exposure).  In these
 * coordinates a power law (gamma curve, linear sensor) is a straight line, so a smoothness
 * penalty on g'' pulls towards a power law where the data say nothing.  Debevec & Malik's
 * one-unknown-per-code table is the limit of many knots; a spline keeps 16-bit codes affordable.
 */
#ifndef HDRGEN_BASIS_H
#define HDRGEN_BASIS_H

enum { BASIS_INTERVALS = 24, BASIS_N = BASIS_INTERVALS + 3 };

typedef struct basis {
    double knot[BASIS_INTERVALS + 7]; /* in v = ln z, both ends threefold beyond the clamped one */
    double max_code;
} basis;

/* Knots for codes 1..max_code: dense at the dark end, a little at the bright end. */
void basis_init(basis *b, double max_code);

/* The four non-zero functions at v: B_{first}..B_{first+3}; v is clamped to the knots' range.
 * deriv 0, 1 or 2 with respect to v.  Returns first. */
int basis_eval(const basis *b, double v, int deriv, double out[4]);

/* sum_j c_j B_j(v), beyond the ends continued in a straight line. */
double basis_curve(const basis *b, const double c[BASIS_N], double v);

#endif
