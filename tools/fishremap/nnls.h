/*
 * nnls.h - min |A x - b| over x >= 0: Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23;
 * each subproblem goes through QR.
 *
 * This is scipy.optimize.nnls and the book's Fortran NNLS; LAPACK, which solves the subproblems, has no such
 * routine, and no library that our machines have for C does.
 */
#ifndef NNLS_H
#define NNLS_H

/* x: n unknowns; a: row-major, m x n with m >= n.  -1: no memory, or a subproblem that LAPACK can't solve. */
int nnls(double *x, int n, const double *a, const double *b, int m);

#endif
