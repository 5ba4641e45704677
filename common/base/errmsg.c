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

/* Bytes of the UTF-8 character at s, or 0 where there is none that may be shown: control
 * characters, and bytes that are no UTF-8 (a broken file's header quoted in a message). */
static size_t showable(const unsigned char *s)
{
    if (s[0] >= 0x20 && s[0] < 0x7f) return 1;
    size_t n = s[0] >= 0xc2 && s[0] < 0xe0   ? 2
               : (s[0] & 0xf0) == 0xe0       ? 3
               : s[0] >= 0xf0 && s[0] < 0xf5 ? 4
                                             : 0;
    for (size_t i = 1; i < n; i++)
        if ((s[i] & 0xc0) != 0x80) return 0;
    return n == 2 && s[0] == 0xc2 && s[1] < 0xa0 ? 0 : n; /* U+0080 to U+009F are controls */
}

static void put(errmsg *e, const char *text)
{
    size_t to = 0;
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        size_t n = showable(s);
        if (to + (n ? n : 1) >= sizeof e->text) break;
        if (n) memcpy(e->text + to, s, n);
        else e->text[to] = '?';
        to += n ? n : 1;
        s += n ? n : 1;
    }
    e->text[to] = 0;
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
