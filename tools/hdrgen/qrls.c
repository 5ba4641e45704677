/*
 * qrls.c - see qrls.h.  Householder reflections: Golub & Van Loan, Matrix Computations, 5.1, 5.2.
 */
#include "qrls.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <lapacke.h>

enum { BLOCK = 512 }; /* rows gathered before each factorisation */

struct qrls {
    int n;      /* columns of A */
    int filled; /* rows in use, the triangle's among them */
    int cap;
    int failed; /* -1; -2: out of memory */
    long rows;
    double *a;   /* cap x (n+1), row-major */
    double *col; /* the same, column-major, for LAPACK */
    double *tau;
};

qrls *qrls_new(int columns)
{
    qrls *q = calloc(1, sizeof *q);
    if (!q) return NULL;
    size_t m = (size_t)columns + 1;
    q->n = columns;
    q->cap = columns + 1 + BLOCK;
    q->a = malloc((size_t)q->cap * m * sizeof *q->a);
    q->col = malloc((size_t)q->cap * m * sizeof *q->col);
    q->tau = malloc(m * sizeof *q->tau);
    if (!q->a || !q->col || !q->tau) {
        qrls_free(q);
        return NULL;
    }
    return q;
}

void qrls_free(qrls *q)
{
    if (!q) return;
    free(q->a);
    free(q->col);
    free(q->tau);
    free(q);
}

int qrls_columns(const qrls *q)
{
    return q->n;
}

static int no_memory(lapack_int info)
{
    return info == LAPACK_WORK_MEMORY_ERROR || info == LAPACK_TRANSPOSE_MEMORY_ERROR;
}

/* Fold everything into one triangle, b included as the last column. */
static void fold(qrls *q)
{
    int m = q->n + 1, rows = q->filled;
    if (rows == 0 || q->failed) return;
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < m; j++)
            q->col[(size_t)j * (size_t)rows + (size_t)i] = q->a[(size_t)i * (size_t)m + (size_t)j];
    lapack_int info = LAPACKE_dgeqrf(LAPACK_COL_MAJOR, rows, m, q->col, rows, q->tau);
    if (info != 0) {
        q->failed = no_memory(info) ? -2 : -1;
        return;
    }
    int keep = rows < m ? rows : m;
    for (int i = 0; i < keep; i++)
        for (int j = 0; j < m; j++)
            q->a[(size_t)i * (size_t)m + (size_t)j] =
                j < i ? 0 : q->col[(size_t)j * (size_t)rows + (size_t)i];
    q->filled = keep;
}

double *qrls_row(qrls *q)
{
    if (q->filled == q->cap) fold(q);
    if (q->failed) return NULL;
    size_t m = (size_t)q->n + 1;
    double *row = q->a + (size_t)q->filled * m;
    memset(row, 0, m * sizeof *row);
    q->filled++;
    q->rows++;
    return row;
}

int qrls_add_eliminating(qrls *q, double *rows, double *nuisance, int n)
{
    int m = q->n + 1;
    double norm = 0;
    for (int i = 0; i < n; i++) norm += nuisance[i] * nuisance[i];
    if (!(norm > 0)) return 0;
    norm = sqrt(norm);
    /* v = u + sign(u0)|u| e0 ; H = I - 2 v v^T / v^T v turns u into a multiple of e0 */
    double *v = nuisance;
    v[0] += v[0] < 0 ? -norm : norm;
    double vv = 0;
    for (int i = 0; i < n; i++) vv += v[i] * v[i];
    for (int j = 0; j < m; j++) {
        double dot = 0;
        for (int i = 0; i < n; i++) dot += v[i] * rows[(size_t)i * (size_t)m + (size_t)j];
        if (dot == 0) continue;
        dot *= 2 / vv;
        for (int i = 0; i < n; i++) rows[(size_t)i * (size_t)m + (size_t)j] -= dot * v[i];
    }
    for (int i = 1; i < n; i++) { /* row 0 only determines the nuisance unknown */
        double *row = qrls_row(q);
        if (!row) return -1;
        memcpy(row, rows + (size_t)i * (size_t)m, (size_t)m * sizeof *row);
    }
    return 0;
}

int qrls_solve(qrls *q, double *x, double rcond, qrls_facts *facts, errmsg *e)
{
    fold(q);
    if (q->failed) {
        err_set(e, q->failed == -2 ? "least squares: out of memory"
                                   : "least squares: LAPACK's QR factorisation failed");
        return q->failed;
    }
    int n = q->n, m = n + 1;
    double *r = calloc((size_t)n * (size_t)n, sizeof *r);
    double *b = calloc((size_t)n, sizeof *b);
    double *s = calloc((size_t)n, sizeof *s);
    int code = -1, rank = 0;
    if (!r || !b || !s) {
        err_set(e, "least squares: out of memory");
        code = -2;
        goto done;
    }
    for (int i = 0; i < n && i < q->filled; i++) {
        for (int j = 0; j < n; j++)
            r[(size_t)j * (size_t)n + (size_t)i] = q->a[(size_t)i * (size_t)m + (size_t)j];
        b[i] = q->a[(size_t)i * (size_t)m + (size_t)n];
    }
    lapack_int info = LAPACKE_dgelsd(LAPACK_COL_MAJOR, n, n, 1, r, n, b, n, s, rcond, &rank);
    if (info != 0) {
        code = no_memory(info) ? -2 : -1;
        err_set(e, code == -2 ? "least squares: out of memory"
                              : "least squares: LAPACK's singular values did not converge");
        goto done;
    }
    for (int i = 0; i < n; i++)
        if (!isfinite(b[i])) {
            err_set(e, "least squares: the solution is not finite");
            goto done;
        }
    memcpy(x, b, (size_t)n * sizeof *x);
    if (facts) {
        double low = q->filled > n ? q->a[(size_t)n * (size_t)m + (size_t)n] : 0;
        facts->rank = rank;
        facts->condition = rank > 0 && s[rank - 1] > 0 ? s[0] / s[rank - 1] : INFINITY;
        facts->rss = low * low;
        facts->rows = q->rows;
    }
    code = 0;
done:
    free(r);
    free(b);
    free(s);
    return code;
}
