/*
 * output.h - the light field with its lamps taken out, as a file of version 2.
 */
#ifndef OUTPUT_H
#define OUTPUT_H

#include "fewer.h"

typedef struct storage {
    const char *type;        /* half, float; NULL: half where it holds all texels */
    const char *compression; /* as ilfpack's; NULL: zip where texels are rounded, else none */
    int interleave;
    int fewer; /* fewer probes, as the plan says */
    fewplan few;
    double tolerance; /* texels are rounded within it; 0: they are not */
} storage;

/* Are the options for storage such that a file can be written? */
int storage_check(const storage *s, errmsg *e);

/* Write what is left in the probes and the lamps.  `input` hands on who made it, when, and how; line is the
 * command line.  Without lamps the file is of version 1, and *lamps is 0.  What rounding did is said. */
int output_write(const char *path, const char *input, const analysis *a, const storage *s, const char *line,
                 int *lamps, errmsg *e);

#endif
