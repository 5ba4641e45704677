/* curvefile.c - reads the text files of curvefile.h and refuses what is not a curve. */
#include "curvefile.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_POINTS = 1 << 20 };

void curve_free(curve3 *c)
{
    free(c->x);
    free(c->y);
    memset(c, 0, sizeof *c);
}

static int grow(curve3 *c, int *room, errmsg *e)
{
    int want = *room ? *room * 2 : 64;
    double *x = realloc(c->x, (size_t)want * sizeof *x);
    if (x) c->x = x;
    double(*y)[3] = realloc(c->y, (size_t)want * sizeof *y);
    if (y) c->y = y;
    if (!x || !y) return err_set(e, "out of memory");
    *room = want;
    return 0;
}

/* Numbers of one line: how many were found (at most 5), or -1 when something else is there. */
static int numbers(double v[5], char *line)
{
    int n = 0;
    char *hash = strchr(line, '#'), *p = line, *end;
    if (hash) *hash = 0;
    while (n < 5) {
        p += strspn(p, " \t\r\n,");
        if (!*p) return n;
        v[n] = strtod(p, &end);
        if (end == p || !isfinite(v[n])) return -1;
        n++;
        p = end;
    }
    return n;
}

static int load(curve3 *out, const char *path, errmsg *e)
{
    curve3 c = {0};
    int room = 0, line_no = 0, bad = 0;
    char line[1024];
    FILE *f = fopen(path, "r");
    if (!f) return err_errno(e, "%s", path);
    while (!bad && fgets(line, sizeof line, f)) {
        double v[5];
        int n = strncmp(line, "hdrgen-response ", 16) && strncmp(line, "channels ", 9) &&
                        strncmp(line, "max_code ", 9) && strncmp(line, "origin ", 7)
                    ? numbers(v, line)
                    : 0;
        line_no++;
        if (n == 0) continue;
        if (n != 2 && n != 4)
            bad = err_set(e, "%s:%d: expected 'x y' or 'x R G B' in numbers", path, line_no);
        else if (c.n > 0 && !(v[0] > c.x[c.n - 1]))
            bad = err_set(e, "%s:%d: expected x above %g, found %g", path, line_no, c.x[c.n - 1], v[0]);
        else if (c.n == MAX_POINTS) bad = err_set(e, "%s: expected at most %d lines", path, MAX_POINTS);
        else if (c.n == room && grow(&c, &room, e) != 0) bad = -1;
        if (bad) break;
        c.x[c.n] = v[0];
        for (int k = 0; k < 3; k++) c.y[c.n][k] = n == 2 ? v[1] : v[1 + k];
        c.n++;
    }
    if (!bad && ferror(f)) bad = err_errno(e, "%s", path);
    fclose(f);
    if (!bad && c.n < 2) bad = err_set(e, "%s: expected at least two points, found %d", path, c.n);
    if (bad) {
        curve_free(&c);
        return -1;
    }
    *out = c;
    return 0;
}

int curve_load_falloff(curve3 *out, const char *path, errmsg *e)
{
    curve3 c;
    if (load(&c, path, e) != 0) return -1;
    for (int i = 0; i < c.n; i++)
        for (int k = 0; k < 3; k++)
            if (!(c.y[i][k] > 0)) {
                err_set(e, "%s: expected falloff above zero at %g degrees, found %g", path, c.x[i],
                        c.y[i][k]);
                curve_free(&c);
                return -1;
            }
    *out = c;
    return 0;
}

int curve_load_response(curve3 *out, const char *path, errmsg *e)
{
    curve3 c;
    if (load(&c, path, e) != 0) return -1;
    double top_code = c.x[c.n - 1];
    int bad = c.x[0] >= 0 ? 0 : err_set(e, "%s: expected codes from 0 up, found %g", path, c.x[0]);
    for (int k = 0; k < 3 && !bad; k++) {
        double top = c.y[c.n - 1][k];
        for (int i = 0; i < c.n && !bad; i++)
            if (c.y[i][k] < 0 || (i > 0 && !(c.y[i][k] > c.y[i - 1][k])))
                bad = err_set(e, "%s: expected exposures that rise with the code, found %g at code %g", path,
                              c.y[i][k], c.x[i]);
        for (int i = 0; i < c.n && !bad; i++) c.y[i][k] /= top;
    }
    for (int i = 0; i < c.n && !bad; i++) c.x[i] /= top_code;
    if (bad) {
        curve_free(&c);
        return -1;
    }
    *out = c;
    return 0;
}
