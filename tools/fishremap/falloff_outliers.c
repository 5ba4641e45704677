/*
 * falloff_outliers.c - outliers of a falloff's readings (falloff_outliers.h).
 *
 * First by neighbours alone, worst first, since several wild readings would spoil any curve through all: the
 * cubic through two neighbours on either side, in units of the noise that such cubics show all over and of
 * what they differ from the straight line (the curve's own bend).  Then by the fit's leave-one-out deviations
 * against Student's t, out and in again, until nothing changes.
 */
#include "falloff_outliers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LOCAL 5.0 /* such units; who is turned away for nothing is taken back by the fit */

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

typedef struct place {
    double t;
    int i;
} place;

static int by_angle(const void *a, const void *b)
{
    const place *p = a, *q = b;
    return p->t != q->t ? (p->t > q->t) - (p->t < q->t) : p->i - q->i;
}

/* Lagrange's polynomial through m readings at angle t; *gain: what their independent noise becomes. */
static double through(double *gain, const fit_data *d, const int *at, int m, double t)
{
    double v = 0;
    *gain = 0;
    for (int j = 0; j < m; j++) {
        double w = 1;
        for (int k = 0; k < m; k++)
            if (k != j) w *= (t - d->t[at[k]]) / (d->t[at[j]] - d->t[at[k]]);
        v += w * d->y[at[j]];
        *gain += w * w;
    }
    return v;
}

/* The nearest readings that count at other angles: up to two on either side of order[k]; -1 where a side has
 * none. */
static int neighbours(int at[4], int near[2], const fit_data *d, const place *order, int k)
{
    int m = 0;
    for (int side = -1; side <= 1; side += 2) {
        double last = d->t[order[k].i];
        int found = 0;
        for (int j = k + side; j >= 0 && j < d->n && found < 2; j += side) {
            int i = order[j].i;
            if (!d->in[i] || fabs(d->t[i] - last) < 1e-6) continue;
            if (!found) near[side > 0] = i;
            at[m++] = i, last = d->t[i], found++;
        }
        if (!found) return -1;
    }
    return m;
}

/* Readings that contradict neighbours who agree; worst first. */
static int by_neighbours(fit_data *d)
{
    place *order = malloc(sizeof *order * (size_t)d->n);
    double *off = malloc(sizeof(double) * 4 * (size_t)d->n), *unit = off + d->n, *bend = off + 2 * d->n,
           *some = off + 3 * d->n;
    if (!order || !off) {
        free(order);
        free(off);
        return -1;
    }
    for (int i = 0; i < d->n; i++) order[i] = (place){d->t[i], i};
    qsort(order, (size_t)d->n, sizeof *order, by_angle);
    for (int left = d->n / 3; left > 0; left--) {
        int count = 0, worst = -1;
        for (int k = 0; k < d->n; k++) {
            int at[4], near[2], m, i = order[k].i;
            double gain, gain2;
            unit[k] = 0;
            if (!d->in[i] || (m = neighbours(at, near, d, order, k)) < 3) continue;
            double cubic = through(&gain, d, at, m, d->t[i]), straight = through(&gain2, d, near, 2, d->t[i]);
            off[k] = d->y[i] - cubic, unit[k] = sqrt(1 + gain), bend[k] = fabs(cubic - straight);
            some[count++] = fabs(off[k]) / unit[k];
        }
        if (count < 3) break;
        qsort(some, (size_t)count, sizeof *some, by_value);
        /* by their fifth: one wild reading spoils what is said of its four neighbours, so three may spoil
         * most */
        double scale = fmax(some[(count - 1) / 5] / 0.2533, FIT_LEAST_NOISE), most = LOCAL;
        for (int k = 0; k < d->n; k++) {
            if (unit[k] == 0) continue;
            double q = fabs(off[k]) / hypot(scale * unit[k], bend[k]);
            if (q > most) most = q, worst = k;
        }
        if (worst < 0) break;
        d->in[order[worst].i] = 0;
    }
    free(order);
    free(off);
    return 0;
}

/* Two-sided limit of Student's t for 2 in 10000, to a few percent from 3 degrees of freedom on. */
static double limit_of_t(double dof)
{
    dof = fmax(dof, 2);
    return 3.8 * (1 + 3.5 / dof + 12 / (dof * dof) + 60 / (dof * dof * dof));
}

static int is_last(const fit_data *d, int i)
{
    for (int k = 0; k < d->n; k++)
        if (d->in[k] && k != i && d->t[k] >= d->t[i]) return 0;
    return 1;
}

/* How far reading i is off, in standard deviations.  Of the last one, what falls off beyond the rest is a
 * lens's way, down to a third. */
static double wildness(const fit_data *d, const double *t, const double *off, int i)
{
    return is_last(d, i) && off[i] < 0 && off[i] > -1.1 ? fabs(t[i]) / 4 : fabs(t[i]);
}

int fit_outliers(fit_data *d)
{
    if (d->n < 5) return 0;
    double *t = malloc(2 * sizeof *t * (size_t)d->n), *off = t + d->n;
    if (!t || by_neighbours(d)) {
        free(t);
        return -1;
    }
    int rc = 0;
    for (int it = 0; !rc && it < 4 * d->n && it < 200; it++) {
        int count = 0, worst = -1, back = -1;
        for (int i = 0; i < d->n; i++) count += d->in[i];
        rc = fit_deleted(t, off, d);
        if (rc) break;
        double limit = limit_of_t(count - 3), most = limit, least = it < 2 * d->n ? 0.75 * limit : 0;
        for (int i = 0; i < d->n; i++) {
            const double q = wildness(d, t, off, i);
            if (d->in[i] && q > most) most = q, worst = i;
            if (!d->in[i] && q < least) least = q, back = i;
        }
        if (worst >= 0 && count > 4) d->in[worst] = 0;
        else if (back >= 0) d->in[back] = 1;
        else break;
    }
    free(t);
    return rc;
}
