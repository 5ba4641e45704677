/*
 * report.h - what was found, as JSON.
 */
#ifndef REPORT_H
#define REPORT_H

#include <stdio.h>

#include "analysis.h"

/* Its parts, for other reports: a string in quotes, and the member "lamps" with its list, the last one. */
void report_text(FILE *o, const char *s);
void report_lamps(FILE *o, const analysis *a);

int report_write(const char *path, const char *input, const analysis *a, errmsg *e);

#endif
