/*
 * ini.h - sections, keys and values out of text (pure).
 *
 * "[section]", "key = value"; lines that begin with '#' or ';' are comments; a line that begins with a blank
 * goes on with the value before, joined by one blank.  Nothing else is allowed.
 *
 * This is Python's configparser with delimiters "=" and no interpolation, keys as they are written, and
 * an empty line ends a value.  libinih,
 * the library for C, does not serve as distributions build it: it gives no line numbers for messages, cuts
 * lines at 200 bytes and values at " ;" (camera commands have both), and gives a value's further lines as
 * values of their own.
 */
#ifndef INI_H
#define INI_H

#include "base/errmsg.h"

/* One key.  Return 0, or -1 with words. */
typedef int ini_fn(void *arg, const char *section, const char *key, const char *value, int line, errmsg *e);

/* text is changed in place.  name stands in messages: "name:line: ...". */
int ini_parse(char *text, const char *name, ini_fn *take, void *arg, errmsg *e);

#endif
