/*
 * report.h - what was found and how long it took, as JSON.
 */
#ifndef REPORT_H
#define REPORT_H

#include "base/errmsg.h"
#include "outcome.h"

/* One object; numbers to 9 digits, null where one is not finite. */
int report_write(const char *path, const outcome *o, errmsg *e);

#endif
