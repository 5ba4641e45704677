/*
 * report.h - what was found, as JSON.
 */
#ifndef REPORT_H
#define REPORT_H

#include "analysis.h"

int report_write(const char *path, const char *input, const analysis *a, errmsg *e);

#endif
