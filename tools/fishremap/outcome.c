/* outcome.c - see outcome.h. */
#include "outcome.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void outcome_note(outcome *o, const char *fmt, ...)
{
    va_list ap;
    size_t n = strlen(o->remark);
    if (n && n + 2 < sizeof o->remark) n += (size_t)snprintf(o->remark + n, sizeof o->remark - n, "; ");
    va_start(ap, fmt);
    vsnprintf(o->remark + n, sizeof o->remark - n, fmt, ap);
    va_end(ap);
}
