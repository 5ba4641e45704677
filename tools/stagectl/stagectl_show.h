/*
 * stagectl_show.h - the commands of stagectl that only look at a session file: for its main, so they print
 * and exit.
 */
#ifndef STAGECTL_SHOW_H
#define STAGECTL_SHOW_H

#include "session.h"

/* Exit code CLI_OK, or they end the program. */
int show_plan(const char *path, const char *device); /* its port; "" or NULL = the session's */
int show_get(const char *path, const char *what);
int show_list(const char *path);
int show_seen(const char *path);
int show_keys(void);

void load_session(session *s, const char *path);

/* Free bytes where the folder is or will be; -1 = not known. */
double free_bytes(const char *folder);

#endif
