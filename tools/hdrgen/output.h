/*
 * output.h - the merged picture as a file, with how it was made in its header.
 */
#ifndef HDRGEN_OUTPUT_H
#define HDRGEN_OUTPUT_H

#include "job.h"

typedef enum output_type { OUTPUT_FLOAT, OUTPUT_HALF } output_type;

typedef struct output_opts {
    const char *path;
    output_type type;
    const char *compression; /* as img_write_opts, or NULL */
    int want_flags;
    const char *command; /* command line, for the header */
} output_opts;

/* Write j's picture.  HALF becomes FLOAT where half would overflow or lose bits: *type_used says. */
int output_write(const job *j, const output_opts *o, output_type *type_used, errmsg *e);

#endif
