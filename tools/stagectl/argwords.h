/*
 * argwords.h - a command line in a string as an argument vector, without a shell.
 *
 * Words are parted by blanks; '...' keeps everything, "..." keeps everything but \" and \\, and a
 * backslash outside quotes keeps the next character.  Nothing is expanded.
 *
 * This is Python's shlex.split(); libc's wordexp() expands, and refuses what a shell would take for more.
 */
#ifndef ARGWORDS_H
#define ARGWORDS_H

#include "base/errmsg.h"

typedef struct argwords {
    int n;
    char **word; /* n + 1 pointers, the last NULL; one allocation holds pointers and text */
} argwords;

int argwords_split(argwords *a, const char *text, errmsg *e);
void argwords_free(argwords *a);

#endif
