/*
 * edit.c - lamps made brighter, of another colour, or put out.
 */
#include "edit.h"

#include <stdlib.h>
#include <string.h>

#include "base/cli.h"

int edit_lamp(analysis *a, const char *edit, errmsg *e)
{
    char *end;
    const long k = strtol(edit, &end, 10);
    double v[3] = {0, 0, 0};
    errmsg words;

    if (end == edit || *end != '.')
        return err_set(e, "--set: expected K.gain=X, K.rgb=R,G,B or K.off, found \"%s\"", edit);
    if (k < 1 || k > a->n)
        return err_set(e, "--set %s: expected a lamp from 1 to %d, found %ld", edit, a->n, k);
    if (a->lamps[k - 1].fate != TAKEN)
        return err_set(e, "--set %s: lamp %ld stays in the field: it can't be changed", edit, k);
    float *rgb = a->lamps[k - 1].l.s.l.rgb;
    const char *what = end + 1;
    if (!strncmp(what, "gain=", 5)) {
        if (cli_parse_double(v, what + 5, &words)) return err_set(e, "--set %s: %s", edit, words.text);
        if (v[0] < 0) return err_set(e, "--set %s: expected a number from 0, found %g", edit, v[0]);
        for (int c = 0; c < 3; c++) rgb[c] *= (float)v[0];
    } else if (!strncmp(what, "rgb=", 4)) {
        if (cli_parse_doubles(v, 3, what + 4, ",", &words))
            return err_set(e, "--set %s: %s", edit, words.text);
        for (int c = 0; c < 3; c++) rgb[c] = (float)v[c];
    } else if (!strcmp(what, "off")) memset(rgb, 0, 3 * sizeof *rgb);
    else return err_set(e, "--set: expected K.gain=X, K.rgb=R,G,B or K.off, found \"%s\"", edit);
    a->lamps[k - 1].l.s.radiance = ilf_luminance(rgb);
    return 0;
}
