/*
 * cli_values.c - the values that many options share: numbers, lists of numbers, sizes.
 * Each takes the whole string or fails; outputs are untouched on failure.
 */
#include "cli.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_LIST = 64 };

/* A finite decimal number at the start of s; *end after it. */
static int number(double *v, const char *s, const char **end)
{
    if (isspace((unsigned char)*s) || *s == 0) return -1;
    char *stop;
    double x = strtod(s, &stop);
    if (stop == s || !isfinite(x)) return -1;
    *v = x;
    *end = stop;
    return 0;
}

int cli_parse_double(double *v, const char *s, errmsg *e)
{
    const char *end;
    double num, den = 1;
    int ok = number(&num, s, &end) == 0;
    if (ok && *end == '/') ok = number(&den, end + 1, &end) == 0 && den != 0;
    if (!ok || *end || !isfinite(num / den)) return err_set(e, "expected a finite number, found '%s'", s);
    *v = num / den;
    return 0;
}

int cli_parse_share(double *v, double most, const char *s, errmsg *e)
{
    const char *end;
    double x;
    int ok = number(&x, s, &end) == 0;

    if (ok && *end == '%') x /= 100, end++;
    if (!ok || *end || !(x > 0) || x > most)
        return err_set(e, "expected a share above 0 and to %g%%, such as 1%% or .01, found '%s'", 100 * most,
                       s);
    *v = x;
    return 0;
}

int cli_parse_doubles(double *v, int n, const char *s, const char *sep, errmsg *e)
{
    double list[MAX_LIST];
    int found = 0;
    const char *p = s;
    if (n < 1 || n > MAX_LIST) return err_set(e, "expected a list of 1 to %d numbers", MAX_LIST);
    p += strspn(p, " ");
    while (*p && found <= n) {
        size_t len = strcspn(p, sep);
        char one[64];
        if (len == 0 || len >= sizeof one) break;
        memcpy(one, p, len);
        one[len] = 0;
        while (len > 0 && one[len - 1] == ' ') one[--len] = 0;
        double x;
        if (cli_parse_double(&x, one, NULL) < 0) return err_set(e, "expected %d numbers, found '%s'", n, s);
        if (found < n) list[found] = x;
        found++;
        p += strcspn(p, sep);
        if (!*p) break;
        char between = *p++;
        p += strspn(p, " ");
        if (!*p && between != ' ') found = n + 1; /* ends with a separator */
    }
    if (found != n || *p) return err_set(e, "expected %d number%s, found '%s'", n, n == 1 ? "" : "s", s);
    memcpy(v, list, (size_t)n * sizeof *v);
    return 0;
}

int cli_parse_size(int *w, int *h, const char *s, errmsg *e)
{
    long side[2] = {0, 0};
    const char *p = s;
    for (int i = 0; i < 2; i++) {
        char *end = NULL;
        errno = 0;
        if (isdigit((unsigned char)*p)) side[i] = strtol(p, &end, 10);
        if (!end || errno || side[i] < 1 || side[i] > INT_MAX || *end != (i == 0 ? 'x' : '\0'))
            return err_set(e, "expected WxH with both at least 1, found '%s'", s);
        p = end + 1;
    }
    *w = (int)side[0];
    *h = (int)side[1];
    return 0;
}
