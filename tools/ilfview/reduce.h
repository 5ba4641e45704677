/*
 * reduce.h - pictures made smaller, light kept.  Pure.
 */
#ifndef VIEW_REDUCE_H
#define VIEW_REDUCE_H

#include "ilf_luminaire.h"

/* A probe of nt x np texels (columns of azimuth, rows of polar angle; R G B) from one of NT x NP, both up to
 * polar_max: each texel the mean, by solid angle, of what it covers.  Needs 0 < nt <= NT, 0 < np <= NP. */
void reduce_probe(float *to, int nt, int np, const float *from, int NT, int NP, double polar_max);

/* The size of a mask's picture when no side has more than 1/factor of its samples (2 at least, factor >= 1). */
void reduce_size(int size[2], const ilf_mask *mask, double factor);

/* The picture at that size (size[0]*size[1]*(nz or 1) floats), bilinear, first and last samples in place. */
void reduce_picture(float *to, const int size[2], const ilf_mask *mask);

#endif
