/*
 * respfile.c - responses in files.
 *
 * Own format: "hdrgen-response 1", "channels N", "max_code M", then lines "code e_1 .. e_N"
 * with rising codes; '#' starts a comment line.  Between two lines ln e is linear in ln code, so a
 * curve saved from 8-bit pictures serves 16-bit ones.  The polynomial format has no heading.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "response.h"

enum { MAX_NODES = 65536, SAVED_NODES = 4096, MAX_ORDER = 30 };
static const char magic[] = "hdrgen-response 1";

typedef struct nodes {
    int channels, n;
    double max_code;
    double *code;
    double *e[RESPONSE_MAX_CHANNELS];
} nodes;

static void nodes_free(nodes *t)
{
    free(t->code);
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) free(t->e[c]);
}

/* One line of at most 3+1 numbers; returns how many, -1 if something else is on it. */
static int numbers(const char *line, double *v, int most)
{
    int n = 0;
    for (;;) {
        char *end;
        while (*line == ' ' || *line == '\t' || *line == '\r' || *line == '\n') line++;
        if (!*line || *line == '#') return n;
        if (n == most) return -1;
        v[n] = strtod(line, &end);
        if (end == line || !isfinite(v[n])) return -1;
        n++;
        line = end;
    }
}

static int read_nodes(nodes *t, FILE *in, const char *path, errmsg *e)
{
    char line[512];
    double v[RESPONSE_MAX_CHANNELS + 1];
    int at = 1;
    t->code = malloc(MAX_NODES * sizeof *t->code);
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) t->e[c] = malloc(MAX_NODES * sizeof *t->e[c]);
    if (!t->code || !t->e[0] || !t->e[1] || !t->e[2]) return err_set(e, "%s: out of memory", path);
    while (fgets(line, sizeof line, in)) {
        at++;
        if (sscanf(line, "channels %d", &t->channels) == 1 || sscanf(line, "max_code %lf", &t->max_code) == 1)
            continue;
        int n = numbers(line, v, RESPONSE_MAX_CHANNELS + 1);
        if (n == 0) continue;
        if (t->channels != 1 && t->channels != 3)
            return err_set(e, "%s: expected \"channels 1\" or \"channels 3\" before line %d", path, at);
        if (n != t->channels + 1)
            return err_set(e, "%s: line %d: expected a code and %d exposures", path, at, t->channels);
        if (t->n == MAX_NODES) return err_set(e, "%s: expected at most %d lines of codes", path, MAX_NODES);
        for (int c = 0; c < t->channels; c++) {
            if (v[0] > 0 ? !(v[c + 1] > 0) : v[c + 1] != 0)
                return err_set(e, "%s: line %d: expected positive exposures (0 at code 0), found %g", path,
                               at, v[c + 1]);
            if (t->n > 0 && !(v[c + 1] > t->e[c][t->n - 1]))
                return err_set(e, "%s: line %d: expected rising exposures, found %g after %g", path, at,
                               v[c + 1], t->e[c][t->n - 1]);
            t->e[c][t->n] = v[c + 1];
        }
        if (v[0] < 0 || (t->n > 0 && !(v[0] > t->code[t->n - 1])))
            return err_set(e, "%s: line %d: expected rising codes, found %g", path, at, v[0]);
        t->code[t->n++] = v[0];
    }
    if (ferror(in)) return err_errno(e, "%s", path);
    int positive = t->n - (t->n > 0 && t->code[0] <= 0 ? 1 : 0);
    if (positive < 2) return err_set(e, "%s: expected at least two codes above 0, found %d", path, positive);
    if (!(t->max_code >= t->code[t->n - 1]))
        return err_set(e, "%s: expected max_code >= %g, found %g", path, t->code[t->n - 1], t->max_code);
    return 0;
}

static void fill_from_nodes(response *r, const nodes *t)
{
    int first = t->code[0] <= 0;
    for (int c = 0; c < r->channels; c++) {
        const double *f = t->e[t->channels == 1 ? 0 : c];
        int i = first;
        r->finv[c][0] = 0;
        for (int z = 1; z <= r->max_code; z++) {
            double code = z * t->max_code / r->max_code;
            while (i + 2 < t->n && t->code[i + 1] < code) i++;
            double u = log(code / t->code[i]) / log(t->code[i + 1] / t->code[i]);
            r->finv[c][z] = exp((1 - u) * log(f[i]) + u * log(f[i + 1]));
        }
    }
}

static int read_polynomial(response *r, FILE *in, const char *path, errmsg *e)
{
    double coef[RESPONSE_MAX_CHANNELS][MAX_ORDER + 1];
    int order[RESPONSE_MAX_CHANNELS], lines = 0;
    rewind(in);
    while (lines < RESPONSE_MAX_CHANNELS && fscanf(in, "%d", &order[lines]) == 1) {
        if (order[lines] < 1 || order[lines] > MAX_ORDER)
            return err_set(e, "%s: polynomial %d: expected an order from 1 to %d, found %d", path, lines + 1,
                           MAX_ORDER, order[lines]);
        for (int k = order[lines]; k >= 0; k--)
            if (fscanf(in, "%lf", &coef[lines][k]) != 1 || !isfinite(coef[lines][k]))
                return err_set(e, "%s: polynomial %d: expected %d coefficients", path, lines + 1,
                               order[lines] + 1);
        lines++;
    }
    if (lines != 1 && lines != 3)
        return err_set(e, "%s: expected \"%s\" or 1 or 3 polynomials, found neither", path, magic);
    for (int c = 0; c < r->channels; c++) {
        int from = lines == 1 ? 0 : c;
        /* a constant term is the camera's black offset in the fit: code 0 means no light here */
        for (int z = 0; z <= r->max_code; z++) {
            double x = (double)z / r->max_code, sum = 0;
            for (int k = order[from]; k >= 0; k--) sum = sum * x + coef[from][k];
            r->finv[c][z] = z ? sum : 0;
        }
    }
    return 0;
}

int response_load(response *r, const char *path, int channels, int max_code, errmsg *e)
{
    char line[512] = "";
    nodes t = {0};
    response got;
    int code = -1;
    FILE *in = fopen(path, "r");
    if (!in) return err_errno(e, "%s", path);
    if (response_alloc(&got, channels, max_code, e)) {
        fclose(in);
        return -1;
    }
    if (fgets(line, sizeof line, in) && strncmp(line, magic, sizeof magic - 1) == 0) {
        if (read_nodes(&t, in, path, e)) goto done;
        if (t.channels == 3 && channels == 1) {
            err_set(e, "%s: expected a response of 1 channel for grey images, found 3", path);
            goto done;
        }
        fill_from_nodes(&got, &t);
    } else if (read_polynomial(&got, in, path, e)) goto done;
    for (int c = 0; c < channels; c++) {
        int changed = response_make_monotone(&got, c);
        if (changed == -2) err_set(e, "%s: out of memory", path);
        else if (changed < 0)
            err_set(e, "%s: expected exposures that are positive and finite above code 0", path);
        if (changed < 0) goto done;
    }
    snprintf(got.origin, sizeof got.origin, "file");
    *r = got;
    memset(&got, 0, sizeof got);
    code = 0;
done:
    nodes_free(&t);
    response_free(&got);
    fclose(in);
    return code;
}

int response_save(const response *r, const char *path, errmsg *e)
{
    outfile *o;
    if (out_begin(&o, path, e)) return -1;
    FILE *out = out_stream(o);
    fprintf(out, "%s\n# code, then the relative exposure per channel; origin: %s\nchannels %d\nmax_code %d\n",
            magic, r->origin, r->channels, r->max_code);
    int n = r->max_code < SAVED_NODES ? r->max_code : SAVED_NODES, last = -1;
    for (int i = 0; i <= n; i++) {
        /* all codes, or closer together where the curve is steep in ln z */
        int z = n == r->max_code ? i : (int)lround(pow((double)i / n, 2) * r->max_code);
        if (z == last) continue;
        last = z;
        fprintf(out, "%d", z);
        for (int c = 0; c < r->channels; c++) fprintf(out, " %.12g", r->finv[c][z]);
        fputc('\n', out);
    }
    return out_commit(o, e);
}
