/*
 * repack.h - a light field into another file: its numbers rounded, otherwise compressed or ordered.
 */
#ifndef REPACK_H
#define REPACK_H

#include "base/errmsg.h"
#include "ilf.h"

typedef struct repackplan {
    const char *source, *target;
    const char *type;        /* half, float; NULL: as the source */
    const char *compression; /* NULL: zip where texels are rounded, else none */
    int interleave;
    double tolerance; /* 0: as they are */
    const char *line; /* the command line */
} repackplan;

/* Does an OpenEXR file say that it is a light field? */
int repack_is_field(const char *path);

/* Plane, lamps, what hides them, and notes are handed on as they are; the command line comes below the old one. */
int repack(const repackplan *p, int dry, errmsg *e);

#endif
