/*
 * lm.c - least squares in a few unknowns (Levenberg-Marquardt, derivatives by differences).
 */
#include "lm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double squares(const double *r, int m)
{
    double sum = 0;

    for (int i = 0; i < m; i++) sum += r[i] * r[i];
    return sum;
}

static void solve(double *x, double a[LM_MOST][LM_MOST], const double *y, int n)
{
    double b[LM_MOST];

    memcpy(b, y, (size_t)n * sizeof *b);
    for (int k = 0; k < n; k++)
        for (int r = k + 1; r < n; r++) {
            const double q = a[k][k] != 0 ? a[r][k] / a[k][k] : 0;
            for (int c = k; c < n; c++) a[r][c] -= q * a[k][c];
            b[r] -= q * b[k];
        }
    for (int k = n; k-- > 0;) {
        x[k] = b[k];
        for (int c = k + 1; c < n; c++) x[k] -= a[k][c] * x[c];
        x[k] = a[k][k] != 0 ? x[k] / a[k][k] : 0;
    }
}

/* One damped step; 1 if it was better. */
static int one_step(double *p, double *best, double *r, double *trial, const double *J, int n, int m,
                    double damp, lm_fn *fn, void *context)
{
    double a[LM_MOST][LM_MOST], y[LM_MOST], dx[LM_MOST], q[LM_MOST];

    for (int k = 0; k < n; k++) {
        y[k] = 0;
        for (int i = 0; i < m; i++) y[k] -= J[k * m + i] * r[i];
        for (int c = 0; c <= k; c++) {
            double sum = 0;
            for (int i = 0; i < m; i++) sum += J[k * m + i] * J[c * m + i];
            a[k][c] = a[c][k] = sum;
        }
    }
    for (int k = 0; k < n; k++) a[k][k] += damp * a[k][k] + 1e-12;
    solve(dx, a, y, n);
    for (int k = 0; k < n; k++) q[k] = p[k] + dx[k];
    fn(trial, q, context);
    const double s = squares(trial, m);
    if (!(s < *best)) return 0;
    *best = s;
    memcpy(p, q, (size_t)n * sizeof *p), memcpy(r, trial, (size_t)m * sizeof *r);
    return 1;
}

double lm_fit(double *p, int n, int m, lm_fn *fn, void *context, const double *step, int rounds)
{
    double *r = malloc((size_t)m * (size_t)(n + 2) * sizeof *r), *trial = r + m, *J = r + 2 * m, damp = 1e-2,
           best;

    if (!r) return -1;
    fn(r, p, context);
    best = squares(r, m);
    for (int round = 0; round < rounds; round++) {
        const double before = best;
        for (int k = 0; k < n; k++) {
            double q[LM_MOST];
            memcpy(q, p, (size_t)n * sizeof *q);
            q[k] += step[k];
            fn(J + k * m, q, context);
            for (int i = 0; i < m; i++) J[k * m + i] = (J[k * m + i] - r[i]) / step[k];
        }
        int better = 0;
        for (int tries = 0; tries < 6 && !better; tries++) {
            better = one_step(p, &best, r, trial, J, n, m, damp, fn, context);
            damp *= better ? .3 : 6;
        }
        if (!better || best > before * (1 - 1e-5)) break;
    }
    free(r);
    return best;
}
