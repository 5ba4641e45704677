/* ini.c - see ini.h. */
#include "ini.h"

#include <ctype.h>
#include <string.h>

static char *trim(char *s)
{
    s += strspn(s, " \t");
    size_t n = strlen(s);
    while (n > 0 && strchr(" \t\r", s[n - 1])) s[--n] = 0;
    return s;
}

static int is_name(const char *s)
{
    if (!*s) return 0;
    for (; *s; s++)
        if (!isalnum((unsigned char)*s) && *s != '_') return 0;
    return 1;
}

/* Join the indented lines after a value to it; returns the rest of the text. */
static char *join(char *value, char *next, int *line)
{
    while (next && (*next == ' ' || *next == '\t')) {
        char *end = strchr(next, '\n');
        if (end) *end = 0;
        char *more = trim(next);
        ++*line;
        if (*more && *more != '#' && *more != ';') {
            char *to = value + strlen(value);
            if (to > value) *to++ = ' ';
            memmove(to, more, strlen(more) + 1);
        }
        next = end ? end + 1 : NULL;
    }
    return next;
}

int ini_parse(char *text, const char *name, ini_fn *take, void *arg, errmsg *e)
{
    char section[64] = "";
    int line = 0;
    for (char *at = text, *next; at; at = next) {
        char *end = strchr(at, '\n');
        int here = ++line;
        if (end) *end = 0;
        next = end ? end + 1 : NULL;
        if (*at == ' ' || *at == '\t') {
            if (*trim(at)) return err_set(e, "%s:%d: an indented line without a key before it", name, here);
            continue;
        }
        char *s = trim(at);
        size_t n = strlen(s);
        if (n == 0 || *s == '#' || *s == ';') continue;
        if (*s == '[') {
            if (s[n - 1] != ']' || n - 2 >= sizeof section)
                return err_set(e, "%s:%d: expected [section]", name, here);
            s[n - 1] = 0;
            strcpy(section, trim(s + 1));
            continue;
        }
        char *eq = strchr(s, '=');
        if (!eq) return err_set(e, "%s:%d: expected 'key = value', found '%s'", name, here, s);
        *eq = 0;
        char *key = trim(s), *value = trim(eq + 1);
        if (!is_name(key))
            return err_set(e, "%s:%d: expected a key of letters, digits and _, found '%s'", name, here, key);
        next = join(value, next, &line);
        errmsg why;
        if (take(arg, section, key, value, here, &why) != 0)
            return err_set(e, "%s:%d: %s", name, here, why.text);
    }
    return 0;
}
