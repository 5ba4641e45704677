/*
 * basis.c - cubic B-splines by Cox and de Boor's recursion (de Boor, A Practical Guide to
 * Splines, ch. X); see basis.h for why v = ln z.
 */
#include "basis.h"

#include <math.h>

void basis_init(basis *b, double max_code)
{
    b->max_code = max_code;
    for (int i = 0; i < BASIS_INTERVALS + 7; i++) {
        int j = i - 3;
        j = j < 0 ? 0 : j > BASIS_INTERVALS ? BASIS_INTERVALS : j;
        double u = (double)j / BASIS_INTERVALS;
        double z = 1 + (max_code - 1) * (0.5 * u * u + 0.25 * (1 - cos(M_PI * u)));
        b->knot[i] = log(z);
    }
}

/* Values of the `order`-th order functions that are non-zero on [knot[s], knot[s+1]]. */
static void cox_de_boor(const double *knot, int s, double v, int order, double *n)
{
    n[0] = 1;
    for (int d = 1; d < order; d++) {
        double saved = 0;
        for (int r = 0; r < d; r++) {
            double right = knot[s + r + 1], left = knot[s + 1 - d + r];
            double t = right > left ? n[r] / (right - left) : 0;
            n[r] = saved + (right - v) * t;
            saved = (v - left) * t;
        }
        n[d] = saved;
    }
}

int basis_eval(const basis *b, double v, int deriv, double out[4])
{
    const double *k = b->knot;
    int lo = 3, hi = BASIS_INTERVALS + 3;
    v = fmin(fmax(v, k[lo]), k[hi]);
    while (hi - lo > 1) {
        int mid = (lo + hi) / 2;
        if (v >= k[mid]) lo = mid;
        else hi = mid;
    }
    int s = lo;
    if (deriv == 0) {
        cox_de_boor(k, s, v, 4, out);
        return s - 3;
    }
    /* d/dv sum c_j B_j,4 = sum 3 (c_j - c_{j-1}) / (knot[j+3] - knot[j]) B_j,3, once or twice */
    double low[4] = {0};
    double coef[4][4]; /* coef[f]: what the lower-order functions are multiplied with for c = e_f */
    cox_de_boor(k, s, v, 4 - deriv, low);
    for (int f = 0; f < 4; f++) {
        double c[4] = {0};
        c[f] = 1;
        for (int d = 1; d <= deriv; d++)
            for (int j = 3; j >= d; j--) {
                double span = k[s + j + 1 - d] - k[s - 3 + j];
                c[j] = span > 0 ? (4 - d) * (c[j] - c[j - 1]) / span : 0;
            }
        for (int j = 0; j < 4; j++) coef[f][j] = c[j];
    }
    for (int f = 0; f < 4; f++) {
        out[f] = 0;
        for (int j = deriv; j < 4; j++) out[f] += coef[f][j] * low[j - deriv];
    }
    return s - 3;
}

static double curve_at(const basis *b, const double *c, double v, int deriv)
{
    double n[4], sum = 0;
    int first = basis_eval(b, v, deriv, n);
    for (int i = 0; i < 4; i++) sum += n[i] * c[first + i];
    return sum;
}

double basis_curve(const basis *b, const double c[BASIS_N], double v)
{
    double lo = b->knot[3], hi = b->knot[BASIS_INTERVALS + 3];
    double at = fmin(fmax(v, lo), hi);
    double g = curve_at(b, c, at, 0);
    return v == at ? g : g + (v - at) * curve_at(b, c, at, 1);
}
