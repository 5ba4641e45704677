/*
 * moments.h - a lamp's extent in space from the second moments of its spots.
 */
#ifndef MOMENTS_H
#define MOMENTS_H

#include "blobs.h"

/* Covariance of the shining surface (unit: the scene's, squared): P cov P / distance^2 is what each spot
 * shows, P projecting along its line of sight; least squares, and where the spots don't say (depth), as large
 * as the mean of the rest. */
void moments_covariance(double cov[3][3], const blob *const *b, int n, const double centre[3],
                        const lightfield *f);

/* Eigenvalues, largest first, and unit eigenvectors of a symmetric matrix. */
void moments_axes(double value[3], double axis[3][3], const double m[3][3]);

#endif
