/*
 * rounding.h - --tolerance: texels of a light field that is written are rounded, and what that does is said.
 */
#ifndef ROUNDING_H
#define ROUNDING_H

#include "ilf.h"

/* The compression of a file for which none was asked: zip where texels are rounded, else none. */
const char *rounding_compression(double tolerance, int interleave);

/* Say what it did to the light: one note. */
void rounding_say(const ilf_loss *loss, const char *path, int lamps);

#endif
