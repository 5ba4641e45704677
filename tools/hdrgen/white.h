/*
 * white.h - from which code on a series is clipped.
 *
 * Files end at 2^b - 1, cameras and converters need not: white may be 250, 235 (video), 65534, 4095 in
 * 16 bits, and another code in each channel.  What is clipped comes out as the same code in exposures of
 * different time, or is one code in the longer of two where the shorter still shows differences; light
 * does neither.
 */
#ifndef HDRGEN_WHITE_H
#define HDRGEN_WHITE_H

#include "base/errmsg.h"
#include "samples.h"

/* clip[c]: codes from there on are clipped; s->max_code where the samples don't show that white lies lower.
 * exposure[k] rises with k. */
int white_find(int clip[RESPONSE_MAX_CHANNELS], const samples *s, const double *exposure, errmsg *e);

/* Make it so: such codes become max_code, which is what the rest takes for clipped. */
void white_apply(samples *s, const int clip[RESPONSE_MAX_CHANNELS]);

#endif
