/*
 * outfile.h - output that is either whole or not there.
 *
 * What is written goes to a new file of unpredictable name beside the target and is
 * renamed over it at the end, so that a killed or failed run leaves the old file or none.
 * The path "-" means standard output: the temporary file then lies in $TMPDIR (or /tmp)
 * and is copied out at commit.  Targets that exist and are not regular files (/dev/null, a
 * pipe) are written to directly at commit in the same way.
 */
#ifndef OUTFILE_H
#define OUTFILE_H

#include <stdio.h>

#include "errmsg.h"

typedef struct outfile outfile;

/* Begin an output.  The handle is owned by the caller until out_commit or out_abort. */
int out_begin(outfile **o, const char *path, errmsg *e);

/* The temporary file: its stream (open for update, empty) or, for libraries that open
 * files by name, its path.  Use one or the other; a library may replace the file. */
FILE *out_stream(outfile *o);
const char *out_path(const outfile *o);

/* Flush, sync, check, rename.  Frees o in every case; on failure the target is untouched
 * and the temporary file gone. */
int out_commit(outfile *o, errmsg *e);

/* Throw the output away.  NULL is allowed. */
void out_abort(outfile *o);

/* Remove every temporary file that is still open; async-signal-safe. */
void out_cleanup(void);

#endif
