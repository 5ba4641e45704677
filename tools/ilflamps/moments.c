/*
 * moments.c - a lamp's extent in space from the second moments of its spots.
 */
#include "moments.h"

#include <math.h>
#include <string.h>

#include "vec.h"

static const int R[6] = {0, 0, 0, 1, 1, 2}, C[6] = {0, 1, 2, 1, 2, 2};

/* Each element of P cov P as a combination of cov's six. */
static void projected(double a[6][6], const double d[3])
{
    for (int e = 0; e < 6; e++)
        for (int u = 0; u < 6; u++) {
            const double pr = (R[e] == R[u]) - d[R[e]] * d[R[u]], pc = (C[u] == C[e]) - d[C[u]] * d[C[e]];
            const double qr = (R[e] == C[u]) - d[R[e]] * d[C[u]], qc = (R[u] == C[e]) - d[R[u]] * d[C[e]];
            a[e][u] = pr * pc + (R[u] != C[u] ? qr * qc : 0);
        }
}

static void solve6(double x[6], double a[6][7])
{
    for (int k = 0; k < 6; k++) {
        int p = k;
        for (int r = k + 1; r < 6; r++)
            if (fabs(a[r][k]) > fabs(a[p][k])) p = r;
        for (int c = 0; c < 7; c++) {
            const double t = a[k][c];
            a[k][c] = a[p][c], a[p][c] = t;
        }
        for (int r = 0; r < 6; r++)
            for (int c = 6; r != k && c >= k; c--) a[r][c] -= a[r][k] / a[k][k] * a[k][c];
    }
    for (int k = 0; k < 6; k++) x[k] = a[k][6] / a[k][k];
}

void moments_covariance(double cov[3][3], const blob *const *b, int n, const double centre[3],
                        const lightfield *f)
{
    double N[6][7] = {{0}}, x[6], mean = 0;

    for (int i = 0; i < n; i++) {
        double a[6][6], e[3];
        v_sub(e, centre, f->pos[b[i]->probe]);
        const double d2 = v_dot(e, e);
        projected(a, b[i]->dir);
        mean += .5 * d2 * (b[i]->spread[0] + b[i]->spread[3] + b[i]->spread[5]) / n;
        for (int q = 0; q < 6; q++)
            for (int r = 0; r < 6; r++) {
                const double w = R[q] == C[q] ? 1 : 2;
                for (int c = 0; c < 6; c++) N[r][c] += w * a[q][r] * a[q][c];
                N[r][6] += w * a[q][r] * b[i]->spread[q] * d2;
            }
    }
    for (int k = 0; k < 6; k++) N[k][k] += .02 * n, N[k][6] += .02 * n * (R[k] == C[k] ? mean : 0);
    solve6(x, N);
    for (int k = 0; k < 6; k++) cov[R[k]][C[k]] = cov[C[k]][R[k]] = x[k];
}

void moments_axes(double value[3], double axis[3][3], const double m[3][3])
{
    double a[3][3];

    memcpy(a, m, sizeof a);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) axis[r][c] = r == c;
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) { /* Jacobi's rotation; rows of axis are the vectors */
                if (a[p][q] == 0) continue;
                const double t = .5 * atan2(2 * a[p][q], a[p][p] - a[q][q]), c = cos(t), s = sin(t);
                for (int k = 0; k < 3; k++) {
                    const double x = a[k][p], y = a[k][q], u = axis[p][k], v = axis[q][k];
                    a[k][p] = c * x + s * y, a[k][q] = c * y - s * x;
                    axis[p][k] = c * u + s * v, axis[q][k] = c * v - s * u;
                }
                for (int k = 0; k < 3; k++) {
                    const double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x + s * y, a[q][k] = c * y - s * x;
                }
            }
    for (int k = 0; k < 3; k++) value[k] = a[k][k];
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            if (value[k] < value[k + 1]) {
                double t = value[k], v[3];
                value[k] = value[k + 1], value[k + 1] = t;
                memcpy(v, axis[k], sizeof v), memcpy(axis[k], axis[k + 1], sizeof v),
                    memcpy(axis[k + 1], v, sizeof v);
            }
}
