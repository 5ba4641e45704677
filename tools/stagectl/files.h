/*
 * files.h - folders and syncing for the capture.
 */
#ifndef FILES_H
#define FILES_H

#include "base/errmsg.h"

/* Make all folders above the last part of path. */
int files_make_parents(const char *path, errmsg *e);

/* fsync a file, or the folder that holds it. */
int files_sync(const char *path, errmsg *e);
int files_sync_parent(const char *path, errmsg *e);

/* "folder/name" in out[room]. */
int files_join(char *out, unsigned room, const char *folder, const char *name, errmsg *e);

#endif
