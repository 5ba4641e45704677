/*
 * falloff_json.h - one set of coefficients out of a falloff's JSON file (falloff.h).
 */
#ifndef FALLOFF_JSON_H
#define FALLOFF_JSON_H

#include "base/errmsg.h"

enum { FALLOFF_MAX_POWER = 32, FALLOFF_NAME = 64 };

/* V(rn) = sum c[k] rn^k.  text: the whole file, which name stands for in messages; set and f_number as for
 * falloff_read.  chosen: the set that was taken from several without being asked for, or "". */
int falloff_json(double c[FALLOFF_MAX_POWER + 1], char chosen[FALLOFF_NAME], const char *text,
                 const char *name, const char *set, double f_number, errmsg *e);

#endif
