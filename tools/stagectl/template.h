/*
 * template.h - {name} and {name:03} in file names and command words (pure).
 *
 * {{ and }} stand for braces.  :0N pads whole numbers with zeros to N digits.
 */
#ifndef TEMPLATE_H
#define TEMPLATE_H

#include <stddef.h>

#include "base/errmsg.h"

typedef struct template_var {
    const char *name; /* NULL ends the list */
    const char *text; /* value as text; NULL: the whole number below */
    long number;
} template_var;

/* Expand into out[room].  Unknown names, bad forms and overlong results are refused. */
int template_expand(char *out, size_t room, const char *text, const template_var *vars, errmsg *e);

#endif
