/*
 * nnls.c - least squares with unknowns that are not negative (nnls.h).
 */
#include "nnls.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

int nnls(double *x, int n, const double *a, const double *b, int m)
{
    double *r = malloc(sizeof(double) * (size_t)m), *sub = malloc(sizeof(double) * (size_t)m * (size_t)n),
           *rhs = malloc(sizeof(double) * (size_t)(m > n ? m : n));
    int *in = calloc((size_t)n, 2 * sizeof *in), *list = in + n, rc = r && sub && rhs && in ? 0 : -1;
    memset(x, 0, sizeof(double) * (size_t)n);
    for (int outer = 0; !rc && outer < 3 * n; outer++) {
        double best = 0;
        int pick = -1;
        for (int i = 0; i < m; i++) {
            r[i] = b[i];
            for (int k = 0; k < n; k++) r[i] -= a[(size_t)i * (size_t)n + (size_t)k] * x[k];
        }
        for (int k = 0; k < n; k++) {
            if (in[k]) continue;
            double s = 0, norm = 0;
            for (int i = 0; i < m; i++)
                s += a[(size_t)i * (size_t)n + (size_t)k] * r[i],
                    norm += a[(size_t)i * (size_t)n + (size_t)k] * a[(size_t)i * (size_t)n + (size_t)k];
            s /= sqrt(norm + 1e-300);
            if (s > best) best = s, pick = k;
        }
        if (pick < 0 || best < 1e-11) break;
        in[pick] = 1;
        for (int inner = 0; inner < 3 * n; inner++) {
            int np = 0;
            for (int k = 0; k < n; k++)
                if (in[k]) list[np++] = k;
            if (!np) break;
            for (int i = 0; i < m; i++) {
                rhs[i] = b[i];
                for (int k = 0; k < np; k++)
                    sub[(size_t)i * (size_t)np + (size_t)k] = a[(size_t)i * (size_t)n + (size_t)list[k]];
            }
            if (LAPACKE_dgels(LAPACK_ROW_MAJOR, 'N', m, np, 1, sub, np, rhs, 1)) {
                rc = -1;
                break;
            }
            double step = 1;
            for (int k = 0; k < np; k++)
                if (rhs[k] <= 0) step = fmin(step, x[list[k]] / (x[list[k]] - rhs[k] + 1e-300));
            for (int k = 0; k < np; k++) x[list[k]] += step * (rhs[k] - x[list[k]]);
            if (step >= 1) break;
            for (int k = 0; k < np; k++)
                if (x[list[k]] <= 1e-14) x[list[k]] = 0, in[list[k]] = 0;
        }
    }
    free(r);
    free(sub);
    free(rhs);
    free(in);
    return rc;
}
