/*
 * curve.c - see curve.h.  Smoothness as in Debevec & Malik (1997), eq. 3, last term, in v = ln z.
 */
#include "curve.h"

#include <math.h>
#include <stddef.h>

enum { PER_INTERVAL = 4 };

/* No camera's or film's curve is far from a power law of exponent 1/2..8 for long: without this, what is
 * below the darkest usable sample would be anything when lambda is tiny. */
static const double usual_slope = 2, slope_spread = 10;

static int slope_prior(qrls *q, const basis *b, const double *c)
{
    for (int i = 0; i < BASIS_INTERVALS; i++) {
        double v = 0.5 * (b->knot[3 + i] + b->knot[4 + i]), n[4], now = 0;
        double w = sqrt(b->knot[4 + i] - b->knot[3 + i]) / slope_spread, *row = qrls_row(q);
        if (!row) return -1;
        int first = basis_eval(b, v, 1, n);
        for (int k = 0; k < 4; k++) {
            row[first + k] = w * n[k];
            now += c ? n[k] * c[first + k] : 0;
        }
        row[qrls_columns(q)] = w * (usual_slope - now);
    }
    return 0;
}

/* d2g/dv2 that curves have at code u * max: next to none where few samples outweigh the read noise (there a
 * power law is the best guess), much from a film's floor on and towards the shoulder. */
static double usual_bend(double u)
{
    double u4 = u * u * u * u;
    return 0.05 + (2 + 16 * u) * u4 / (u4 + 1e-5);
}

int curve_penalty(qrls *q, const basis *b, double lambda, const double *c)
{
    if (slope_prior(q, b, c)) return -1;
    for (int i = 0; i < BASIS_INTERVALS; i++) {
        double v0 = b->knot[3 + i], v1 = b->knot[4 + i], dv = (v1 - v0) / PER_INTERVAL;
        for (int j = 0; j < PER_INTERVAL; j++) {
            double v = v0 + (j + 0.5) * dv, n[4], now = 0;
            double bend = usual_bend(exp(v) / b->max_code);
            int first = basis_eval(b, v, 2, n);
            double w = sqrt(lambda * dv) / bend, *row = qrls_row(q);
            if (!row) return -1;
            for (int k = 0; k < 4; k++) {
                row[first + k] = w * n[k];
                now += c ? n[k] * c[first + k] : 0;
            }
            row[qrls_columns(q)] = -w * now;
        }
    }
    return 0;
}

int curve_gauge(qrls *q, const basis *b, double weight)
{
    enum { STEPS = 256 };
    double *row = qrls_row(q), n[4], sum = 0;
    if (!row) return -1;
    for (int i = 1; i < STEPS; i++) {
        double z = b->max_code * i / STEPS, w = fmin(i, STEPS - i);
        int first = basis_eval(b, log(fmax(z, 1)), 0, n);
        for (int k = 0; k < 4; k++) row[first + k] += w * n[k];
        sum += w;
    }
    for (int k = 0; k < BASIS_N; k++) row[k] *= weight / sum;
    return 0;
}

int curve_to_table(response *r, int ch, const basis *b, const double c[BASIS_N])
{
    for (int z = 1; z <= r->max_code; z++) {
        double g = basis_curve(b, c, log(z));
        if (!(fabs(g) < 300)) return -1;
        r->finv[ch][z] = exp(g);
    }
    r->finv[ch][0] = 0;
    int changed = response_make_monotone(r, ch);
    return changed < 0 ? changed : 0;
}

int curve_from_table(double c[BASIS_N], const response *r, int ch, const basis *b, errmsg *e)
{
    enum { NODES = 512 };
    qrls *q = qrls_new(BASIS_N);
    if (!q) return err_set(e, "out of memory");
    int bad = 0;
    for (int i = 0; i < NODES && !bad; i++) {
        /* evenly in ln z and in z by turns, at whole codes */
        double u = (double)i / (NODES - 1);
        double z = i & 1 ? pow(b->max_code, u) : 1 + (b->max_code - 1) * u;
        int code = (int)lround(fmin(fmax(z, 1), b->max_code));
        double n[4], *row = qrls_row(q);
        if (!row) {
            bad = -1;
            break;
        }
        int first = basis_eval(b, log(code), 0, n);
        for (int k = 0; k < 4; k++) row[first + k] = 1e4 * n[k];
        row[BASIS_N] = 1e4 * log(r->finv[ch][code]);
    }
    if (!bad) bad = curve_penalty(q, b, 1, NULL);
    if (bad) err_set(e, "least squares: LAPACK's QR factorisation failed");
    else bad = qrls_solve(q, c, 1e-13, NULL, e);
    qrls_free(q);
    return bad;
}
