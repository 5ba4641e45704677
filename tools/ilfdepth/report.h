/*
 * report.h - what was found and how sure it is, as JSON.
 */
#ifndef REPORT_H
#define REPORT_H

#include "process.h"

/* Share of the mesh, as seen from the middle of the positions, that was measured; of that the median and the 90 % quantile of the relative
 * standard error. */
typedef struct certainty {
    double measured, median, most;
} certainty;
void report_certainty(certainty *c, const mesh *m, const views *s);

int report_write(const char *path, const char *input, const process *q, errmsg *e);

#endif
