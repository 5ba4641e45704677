/*
 * depends.h - the files that decide what the camera sees, by their contents.
 *
 * A capture is of one room: where it is virtual, octree, falloff and response belong to the session as the
 * grid does. [camera] depends names them; "auto" takes them from a virtualcamera's command.
 */
#ifndef DEPENDS_H
#define DEPENDS_H

#include "session.h"

typedef struct depend {
    char *name;      /* as the session or the command has it */
    char digest[65]; /* SHA-256 with all that it names (scenefiles.h); "" = it is not there */
} depend;

typedef struct depends {
    depend *file;
    int n;
} depends;

/* must_exist: a missing file is an error; else it gets an empty digest. */
int depends_find(depends *d, const session *s, int must_exist, errmsg *e);
void depends_free(depends *d);

#endif
