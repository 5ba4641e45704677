/*
 * curve.h - what every response solve shares: smoothness, the scale that the data
 * leave open (gauge), spline <-> table.
 */
#ifndef HDRGEN_CURVE_H
#define HDRGEN_CURVE_H

#include "base/errmsg.h"
#include "basis.h"
#include "qrls.h"
#include "response.h"

/* Rows lambda-weighted for integral (g''/s)^2 dv with s(v) the bend that a camera's curve may have:
 * little at the dark end, much where shoulders are.  c: where the unknowns stand now (they are changes
 * to it), or NULL when they are the curve itself. */
int curve_penalty(qrls *q, const basis *b, double lambda, const double *c);

/* One heavy row: the hat-weighted mean over the codes of g (of its change) is zero. */
int curve_gauge(qrls *q, const basis *b, double weight);

/* finv = exp(g) into channel ch, made monotone; -1 when the curve is beyond all bounds, -2 when out of
 * memory. */
int curve_to_table(response *r, int ch, const basis *b, const double c[BASIS_N]);

/* The spline nearest to the table. */
int curve_from_table(double c[BASIS_N], const response *r, int ch, const basis *b, errmsg *e);

#endif
