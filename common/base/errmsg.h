/*
 * errmsg.h - the words that go with a failed call.
 *
 * Library functions return 0 on success and -1 on failure and put one line of words into
 * a caller-owned errmsg.  The line names the file and what was expected and found, has no
 * trailing newline and no program name: main() prints it as "prog: line".
 */
#ifndef ERRMSG_H
#define ERRMSG_H

#include <stdarg.h>

typedef struct errmsg {
    char text[1024];
} errmsg;

/* Set e (may be NULL) from a printf format; control characters in the result become '?',
 * so that a hostile file name can't break the one-line rule.  Always returns -1. */
int err_set(errmsg *e, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* As err_set, with ": " and strerror(errno) added. */
int err_errno(errmsg *e, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

#endif
