/*
 * times.c - see times.h.
 */
#include "times.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"

static const char *last_part(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* The shot that a name in the file means, or NULL. */
static shot *find(shot *shots, int n, const char *name)
{
    for (int i = 0; i < n; i++)
        if (strcmp(shots[i].path, name) == 0) return &shots[i];
    for (int i = 0; i < n; i++)
        if (strcmp(last_part(shots[i].path), last_part(name)) == 0) return &shots[i];
    return NULL;
}

/* "image seconds": the image is everything up to the first number after blanks, so that names with
 * blanks work if they are the shot's own; plain names are cut at the first blank. */
static int split(char *line, char **name, char **seconds)
{
    while (*line == ' ' || *line == '\t') line++;
    *name = line;
    if (*line == '"') { /* quoted: names with blanks */
        char *end = strchr(line + 1, '"');
        if (!end) return -1;
        *name = line + 1;
        *end = 0;
        line = end + 1;
    } else {
        line += strcspn(line, " \t");
        if (*line) *line++ = 0;
    }
    line += strspn(line, " \t");
    *seconds = line;
    line[strcspn(line, " \t\r\n")] = 0;
    return **name && **seconds ? 0 : -1;
}

int times_load(shot *shots, int n, const char *path, errmsg *e)
{
    char line[4096];
    errmsg words;
    int at = 0, code = -1;
    FILE *in = fopen(path, "r");
    if (!in) return err_errno(e, "%s", path);
    double *given = calloc((size_t)n, sizeof *given);
    if (!given) {
        err_set(e, "out of memory");
        goto done;
    }
    while (fgets(line, sizeof line, in)) {
        char *name, *seconds;
        double t;
        at++;
        line[strcspn(line, "\r\n")] = 0;
        const char *start = line + strspn(line, " \t");
        if (!*start || *start == '#') continue;
        if (split(line, &name, &seconds)) {
            err_set(e, "%s: line %d: expected \"image seconds\"", path, at);
            goto done;
        }
        shot *s = find(shots, n, name);
        if (cli_parse_double(&t, seconds, &words) || !(t > 0)) {
            err_set(e, "%s: line %d: expected seconds > 0 (\"0.5\", \"1/60\"), found \"%s\"", path, at,
                    seconds);
            goto done;
        }
        if (!s) continue;
        if (given[s - shots] > 0 && given[s - shots] != t) {
            err_set(e, "%s: line %d: expected one time for %s, found a second one", path, at, name);
            goto done;
        }
        given[s - shots] = t;
    }
    if (ferror(in)) {
        err_errno(e, "%s", path);
        goto done;
    }
    for (int i = 0; i < n; i++)
        if (!(given[i] > 0)) {
            err_set(e, "%s: expected a line for %s, found none", path, shots[i].path);
            goto done;
        }
    for (int i = 0; i < n; i++) shots[i].seconds = given[i];
    code = 0;
done:
    free(given);
    fclose(in);
    return code;
}

/* One of the two numbers that may be missing, as a place in shot. */
typedef struct fact {
    size_t at;
} fact;

static double *value(shot *s, const fact *f)
{
    return (double *)((char *)s + f->at);
}

/* *lacks: the first shot without it.  Shots without it get the others', if these agree.  1: they don't agree.
 */
static int fill_in(shot *shots, int n, const fact *f, const char **lacks, double *assumed)
{
    double one = 0, least = INFINITY, most = 0;
    *lacks = NULL;
    for (int i = 0; i < n; i++) {
        double v = *value(&shots[i], f);
        if (v > 0) {
            one = v;
            least = fmin(least, v);
            most = fmax(most, v);
        } else if (!*lacks) {
            *lacks = shots[i].path;
        }
    }
    if (!(one > 0)) *lacks = NULL; /* nobody states it: a lens without contacts */
    if (!*lacks) return 0;
    if (most > least * 1.001) return 1;
    for (int i = 0; i < n; i++) *value(&shots[i], f) = one;
    *assumed = one;
    return 0;
}

int shots_resolve(shot *shots, int n, int times_given, times_facts *facts, errmsg *e)
{
    static const fact iso = {offsetof(shot, iso)}, aperture = {offsetof(shot, f_number)};
    *facts = (times_facts){0};
    for (int i = 0; i < n; i++) {
        if (!(shots[i].seconds > 0))
            return err_set(e, "%s: expected an exposure time in its EXIF data, found none: give --times",
                           shots[i].path);
        if (!isfinite(shots[i].seconds) || shots[i].seconds < 1e-12 || shots[i].seconds > 1e9)
            return err_set(e, "%s: expected an exposure time from 1e-12 to 1e9 s, found %g", shots[i].path,
                           shots[i].seconds);
    }
    int differ_iso = fill_in(shots, n, &iso, &facts->lacks_iso, &facts->iso_assumed);
    int differ_f = fill_in(shots, n, &aperture, &facts->lacks_f, &facts->f_assumed);
    facts->alone = times_given && (differ_iso || differ_f);
    if ((differ_iso || differ_f) && !times_given)
        return err_set(
            e,
            "%s: expected %s in its EXIF data, since the other images' differ, found none: give --times with "
            "the exposures as if ISO and f-number were the same",
            differ_iso ? facts->lacks_iso : facts->lacks_f, differ_iso ? "an ISO" : "an f-number");
    for (int i = 0; i < n; i++) {
        double gain = shots[i].iso > 0 && !facts->alone ? shots[i].iso : 1;
        double light =
            shots[i].f_number > 0 && !facts->alone ? 1 / (shots[i].f_number * shots[i].f_number) : 1;
        shots[i].exposure = shots[i].seconds * (gain * light);
        facts->varies |=
            !facts->alone && (shots[i].iso != shots[0].iso || shots[i].f_number != shots[0].f_number);
    }
    return 0;
}

void shots_relate(shot *shots, int n)
{
    double unit = shots[0].seconds / shots[0].exposure;
    for (int i = 0; i < n; i++) shots[i].exposure *= unit;
}
