/*
 * qrls.h - least squares by orthogonal transformations, rows arriving in any number.
 *
 * min |A x - b|: rows are gathered in a block and folded into an upper triangle by LAPACK's
 * Householder QR, so that memory is O(columns^2) and the condition of A, not of A^T A, counts.
 * The final triangle is solved by its singular values.
 *
 * This is LAPACK's dgelsd (numpy.linalg.lstsq) of all rows at once, whose driver routines want them all in
 * memory: a series has hundreds of thousands, of which each pixel brings an unknown of its own.
 */
#ifndef HDRGEN_QRLS_H
#define HDRGEN_QRLS_H

#include "base/errmsg.h"

typedef struct qrls qrls;

typedef struct qrls_facts {
    double condition; /* largest over smallest singular value that was kept */
    int rank;
    double rss; /* |A x - b|^2 */
    long rows;
} qrls_facts;

/* NULL when memory is short. */
qrls *qrls_new(int columns);
void qrls_free(qrls *q);
int qrls_columns(const qrls *q);

/* A zeroed row of columns+1 doubles (the last is b) to be filled in before the next call.
 * NULL when LAPACK refused an earlier block. */
double *qrls_row(qrls *q);

/* Rows that share one nuisance unknown with coefficient nuisance[i]: it is removed by one
 * Householder reflection before the rows are added (QR with that column in front).  rows is
 * n x (columns+1), overwritten. */
int qrls_add_eliminating(qrls *q, double *rows, double *nuisance, int n);

/* x of minimal norm among the minimisers, singular values below rcond * largest dropped.  -1 failed, -2 out
 * of memory. */
int qrls_solve(qrls *q, double *x, double rcond, qrls_facts *facts, errmsg *e);

#endif
