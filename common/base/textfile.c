/*
 * textfile.c - small text files of numbers (textfile.h).
 */
#include "textfile.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST ((size_t)16 << 20)

int text_read(char **text, const char *path, errmsg *e)
{
    FILE *f = fopen(path, "r");
    if (!f) return err_errno(e, "%s", path);
    size_t room = 65536, n = 0;
    char *s = malloc(room + 1);
    while (s && n < MOST) {
        size_t got = fread(s + n, 1, room - n, f);
        n += got;
        if (!got) break;
        if (n == room) {
            char *q = realloc(s, 2 * room + 1);
            if (!q) {
                free(s);
                s = NULL;
            } else {
                s = q, room *= 2;
            }
        }
    }
    int failed = ferror(f);
    if (failed) err_errno(e, "%s", path);
    fclose(f);
    if (failed) {
        free(s);
        return -1;
    }
    if (!s) return err_set(e, "out of memory");
    if (n >= MOST || memchr(s, 0, n)) {
        free(s);
        return err_set(e, "%s: expected a text file of less than 16 MB", path);
    }
    s[n] = 0;
    *text = s;
    return 0;
}

textlines textlines_of(const char *text)
{
    return (textlines){text, 0};
}

int textlines_next(char *line, size_t room, textlines *t)
{
    while (*t->next) {
        const char *p = t->next, *end = p + strcspn(p, "\n");
        t->next = *end ? end + 1 : end;
        t->number++;
        const char *hash = memchr(p, '#', (size_t)(end - p));
        if (hash) end = hash;
        while (p < end && isspace((unsigned char)*p)) p++;
        while (p < end && isspace((unsigned char)end[-1])) end--;
        size_t n = (size_t)(end - p);
        if (!n) continue;
        int cut = n > room - 1;
        if (cut) n = room - 1;
        memcpy(line, p, n);
        if (cut) line[n - 1] = '~'; /* no number: half of one must not pass for a whole */
        line[n] = 0;
        return 1;
    }
    return 0;
}

int text_numbers(double *v, int max, const char *line)
{
    int n = 0;
    for (const char *p = line;;) {
        while (isspace((unsigned char)*p) || *p == ',' || *p == ';') p++;
        if (!*p) return n;
        char *end;
        double x = strtod(p, &end);
        if (end == p || n == max || !isfinite(x) ||
            (*end && !isspace((unsigned char)*end) && *end != ',' && *end != ';'))
            return -1;
        v[n++] = x;
        p = end;
    }
}
