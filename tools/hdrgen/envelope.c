/*
 * envelope.c - see envelope.h.
 *
 * Asymmetric least squares (Newey and Powell's expectiles, 1987) with a weight that falls once more where the
 * value is far above the sum, so that what is bright has no say in what the dark looks like; the non-negative
 * solution by coordinate descent on the normal equations (Franc, Hlavac and Navara 2005).
 */
#include "envelope.h"

#include <math.h>
#include <string.h>

enum { ROUNDS = 60, SWEEPS = 4000 };
static const double at_first = 0.003;                        /* weight of all places in the first round */
static const double excess = 1, near_sum = 0.02, far = 2e-4; /* weights of the later ones */
static const double near_from = 0.6;                         /* sum over value: from here on near */
static const double same = 1e-3;                             /* rounds end when the solution changes less */
static const double pile_sd = 0.08, any_factor = 7, below = 1e-3; /* noise; ln of all factors; chance */
static const double on_within = 0.15, most_of = 0.5, some_of = 0.3;

static double weight_of(double sum_over_value, int bound)
{
    if (sum_over_value > 1) return excess;
    if (bound) return 0;
    return sum_over_value > near_from ? near_sum : far;
}

/* min 1/2 x'Gx - h'x, x >= 0. */
static void coordinate_descent(double *x, double g[ENVELOPE_MOST][ENVELOPE_MOST], const double *h, int n)
{
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double change = 0, size = 0;
        for (int j = 0; j < n; j++) {
            if (!(g[j][j] > 0)) continue;
            double r = h[j];
            for (int k = 0; k < n; k++) r -= g[j][k] * x[k];
            double to = fmax(x[j] + r / g[j][j], 0);
            change = fmax(change, fabs(to - x[j]));
            size = fmax(size, to);
            x[j] = to;
        }
        if (change <= 1e-7 * size) return;
    }
}

/* Sum at place i over its value. */
static double explained(const envelope *p, int i, const double *x)
{
    const double *a = p->a + (long)i * p->unknowns;
    double sum = 0;
    for (int j = 0; j < p->unknowns; j++) sum += a[j] * x[j];
    return sum / p->value[i];
}

/* Scale of each unknown: its greatest part of any value; 0: it stays 0. */
static void scales(double *scale, const envelope *p, const unsigned char *use, const unsigned char *may)
{
    memset(scale, 0, ENVELOPE_MOST * sizeof *scale);
    for (int i = 0; i < p->places; i++)
        for (int j = 0; j < p->unknowns && (!use || use[i]); j++)
            if (!may || may[j]) scale[j] = fmax(scale[j], p->a[(long)i * p->unknowns + j] / p->value[i]);
}

static void round_of(double *x, const envelope *p, const unsigned char *use, const double *scale, int first)
{
    double g[ENVELOPE_MOST][ENVELOPE_MOST] = {{0}}, h[ENVELOPE_MOST] = {0}, row[ENVELOPE_MOST],
           scaled[ENVELOPE_MOST];
    int n = p->unknowns;
    for (int i = 0; i < p->places; i++) {
        if (use && !use[i]) continue;
        double w = first ? (p->bound[i] ? 0 : at_first) : weight_of(explained(p, i, x), p->bound[i]);
        if (!(w > 0)) continue;
        for (int j = 0; j < n; j++)
            row[j] = scale[j] > 0 ? p->a[(long)i * n + j] / p->value[i] / scale[j] : 0;
        for (int j = 0; j < n; j++) {
            h[j] += w * row[j];
            for (int k = 0; k <= j; k++) g[j][k] += w * row[j] * row[k];
        }
    }
    for (int j = 0; j < n; j++)
        for (int k = j + 1; k < n; k++) g[j][k] = g[k][j];
    for (int j = 0; j < n; j++) scaled[j] = x[j] * scale[j];
    coordinate_descent(scaled, g, h, n);
    for (int j = 0; j < n; j++) x[j] = scale[j] > 0 ? scaled[j] / scale[j] : 0;
}

void envelope_fit(double *x, const envelope *p, const unsigned char *use, const unsigned char *may)
{
    double scale[ENVELOPE_MOST], was[ENVELOPE_MOST] = {0};
    memset(x, 0, (size_t)p->unknowns * sizeof *x);
    scales(scale, p, use, may);
    for (int round = 0; round < ROUNDS; round++) {
        double change = 0, size = 0;
        round_of(x, p, use, scale, round == 0);
        for (int j = 0; j < p->unknowns; j++) {
            change = fmax(change, fabs(x[j] - was[j]) * scale[j]);
            size = fmax(size, x[j] * scale[j]);
            was[j] = x[j];
        }
        if (change <= same * size) return;
    }
}

double envelope_pile_up(const envelope *p, const double *x)
{
    static const double parts[] = {0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9};
    double best = 0;
    for (int k = 0; k < (int)(sizeof parts / sizeof *parts); k++) {
        double sum = 0;
        for (int i = 0; i < p->places; i++) {
            if (p->bound[i]) continue;
            double q = 1 / fmax(explained(p, i, x), 1e-30), z = (q - 1) / pile_sd;
            /* densities of the value: normal about the sum, and even in the logarithm */
            double on = any_factor * q * exp(-0.5 * z * z) / (pile_sd * sqrt(2 * acos(-1)));
            sum += log(z < -3 ? below : 1 - parts[k] + parts[k] * on);
        }
        best = fmax(best, sum);
    }
    return best;
}

envelope_scale envelope_rescale(const envelope *p, const double *curve, const double *rest,
                                const unsigned char *use)
{
    envelope_scale s = {.factor = 1};
    for (int round = 0; round < ROUNDS; round++) {
        double num = 0, den = 0, was = s.factor;
        for (int i = 0; i < p->places; i++) {
            if (!use[i]) continue;
            double c = curve[i] / p->value[i], left = 1 - rest[i] / p->value[i], sum = was * c + 1 - left;
            double w = weight_of(sum, p->bound[i]);
            if (w == near_sum && was * c < near_from * left) w = far;
            num += w * c * left;
            den += w * c * c;
        }
        s.factor = den > 0 ? fmax(num / den, 0) : 0;
        if (fabs(s.factor - was) <= 1e-4 * was) break;
    }
    int some = 0;
    for (int i = 0; i < p->places; i++) {
        if (!use[i] || p->bound[i]) continue;
        double c = s.factor * curve[i] / p->value[i], sum = c + rest[i] / p->value[i];
        some += c > some_of;
        s.on += fabs(sum - 1) < on_within && c > most_of * sum;
    }
    s.share = some ? (double)s.on / some : 0;
    return s;
}
