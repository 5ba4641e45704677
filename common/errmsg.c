/*
 * errmsg.c - formatting the words of a failed call; see errmsg.h.
 *
 * The text is built apart from its destination, so that a message may quote the one that it
 * replaces: err_set(e, "%s: %s", path, e->text).
 */
#include "errmsg.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static void put(errmsg *e, const char *text)
{
    size_t n = strlen(text);
    if (n >= sizeof e->text) n = sizeof e->text - 1;
    for (size_t i = 0; i < n; i++) {
        unsigned char c = (unsigned char)text[i];
        e->text[i] = c < 0x20 || c == 0x7f ? '?' : (char)c;
    }
    e->text[n] = 0;
}

int err_set(errmsg *e, const char *fmt, ...)
{
    if (!e) return -1;
    char line[sizeof e->text];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(line, sizeof line, fmt, ap);
    va_end(ap);
    put(e, line);
    return -1;
}

int err_errno(errmsg *e, const char *fmt, ...)
{
    int code = errno;
    if (!e) return -1;
    char line[sizeof e->text], why[128];
    va_list ap;
    va_start(ap, fmt);
    int n = vsnprintf(line, sizeof line, fmt, ap);
    va_end(ap);
    size_t used = n < 0 ? 0 : (size_t)n < sizeof line ? (size_t)n : sizeof line - 1;
    /* the GNU form: strerror() shares one buffer between threads */
    snprintf(line + used, sizeof line - used, ": %s", strerror_r(code, why, sizeof why));
    put(e, line);
    return -1;
}
