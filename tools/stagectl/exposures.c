/* exposures.c - see exposures.h. */
#include "exposures.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/cli.h"

static int parse_range(double *s, int *n, const char *text, errmsg *e)
{
    char from[64], to[64], step[64], rest;
    double a, b, stops;
    if (sscanf(text, "from %63s to %63s step %63s %c", from, to, step, &rest) != 3)
        return err_set(e, "expected 'from A to B step S' or a list of seconds, found '%s'", text);
    if (cli_parse_double(&a, from, e) || cli_parse_double(&b, to, e) || cli_parse_double(&stops, step, e))
        return -1;
    if (!(a > 0 && b >= a && stops > 0))
        return err_set(e, "expected 0 < A <= B and a step above 0 stops, found '%s'", text);
    double count = floor(log2(b / a) / stops + 1e-6) + 1;
    if (count > EXPOSURES_MAX)
        return err_set(e, "expected at most %d exposures, found %.0f", EXPOSURES_MAX, count);
    for (*n = 0; *n < (int)count; ++*n) s[*n] = a * exp2(*n * stops);
    return 0;
}

int exposures_parse(double *s, int *n, const char *text, errmsg *e)
{
    const char *p = text + strspn(text, " \t");
    if (!strncmp(p, "from ", 5)) return parse_range(s, n, p, e);
    for (*n = 0;;) {
        char word[64];
        p += strspn(p, " \t,");
        size_t len = strcspn(p, " \t,");
        if (len == 0) break;
        if (len >= sizeof word) return err_set(e, "expected seconds, found '%s'", p);
        if (*n == EXPOSURES_MAX) return err_set(e, "expected at most %d exposures", EXPOSURES_MAX);
        memcpy(word, p, len);
        word[len] = 0;
        if (cli_parse_double(&s[*n], word, e) != 0) return -1;
        if (!(s[*n] > 0) || (*n > 0 && !(s[*n] > s[*n - 1])))
            return err_set(e, "expected seconds that rise from above 0, found '%s'", word);
        ++*n;
        p += len;
    }
    return *n > 0 ? 0 : err_set(e, "expected at least one exposure time");
}

int exposures_next(const exposure_seen *seen, int n, int first_guess)
{
    int lo = 0, hi = n - 1;
    while (lo < n && !seen[lo].taken) lo++;
    while (hi >= 0 && !seen[hi].taken) hi--;
    if (lo == n) return first_guess < 0 ? 0 : first_guess >= n ? n - 1 : first_guess;
    for (int k = lo; k < hi; k++)
        if (!seen[k].taken) return k; /* a gap, left by a file that went bad */
    if (seen[lo].clips && lo > 0) return lo - 1;
    if (seen[hi].black && hi < n - 1) return hi + 1;
    return -1;
}

int exposures_guess(const exposure_seen *seen, int n, int otherwise)
{
    for (int k = n - 1; k >= 0; k--)
        if (seen[k].taken && !seen[k].clips) return k;
    for (int k = 0; k < n; k++)
        if (seen[k].taken) return k; /* everything clips, down to the shortest */
    return otherwise;
}
