/*
 * ilfdraw.c - test driver: the sampler of libilf on its own.  Records of doubles in, records of doubles out.
 *
 *   ilfdraw sample FILE [options]   x y z u v w     ->  du dv dn pdf distance expected  (pdf -1: no slice)
 *   ilfdraw pdf FILE [options]      x y z du dv dn  ->  pdf                             (-1: no slice there)
 *   ilfdraw lamps FILE [options]    x y z radius    ->  n, then MOST times x y z radius excess
 *   ilfdraw info FILE [options]                     ->  one line: threshold patches
 *
 * Points are the file's own coordinates, directions the plane's (u, v, n).  The auxiliary geometry is at
 * infinity, or a box or sphere seen from inside, perhaps with a ball in it, with or without the depth
 * correction.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "ilf.h"
#include "surroundings.h"

enum { MOST = 8 };

static int no_depth;
static double cube, threshold;

static const cli_opt opts[] = {
    {"nodepth", 0, CLI_FLAG, &no_depth, NULL, NULL, "lookups without depth correction"},
    SURROUNDINGS_OPTIONS,
    {"cube", 0, CLI_DOUBLE, &cube, NULL, "E", "edge of the cubes of space (default: the library's)"},
    {"threshold", 0, CLI_DOUBLE, &threshold, NULL, "T",
     "luminance that counts as bright (default: the library's)"},
    {0},
};
static const cli_prog prog = {
    "ilfdraw", "sample|pdf|lamps|info FILE", "Draws from a light field's sampler.", opts, "", NULL};

static void ok(ilf_status st, const ilf_error *err)
{
    if (st != ILF_OK) cli_fail(CLI_FAILED, "%s", err->text);
}

static void put(const double *r, size_t n)
{
    if (fwrite(r, sizeof *r, n, stdout) != n) cli_fail(CLI_FAILED, "standard output: cannot write");
}

static void one_record(const char *what, const ilf_patches *bright, ilf_sampler *s, const double *r)
{
    ilf_slice *slice;
    ilf_error err;

    if (strcmp(what, "lamps") == 0) {
        ilf_lamp lamps[MOST];
        double out[1 + 5 * MOST] = {0};
        int n;

        ok(ilf_patches_lamps(lamps, &n, MOST, bright, r, r[3], &err), &err);
        out[0] = n;
        for (int k = 0; k < n; k++) {
            memcpy(out + 1 + 5 * k, lamps[k].position, 3 * sizeof *out);
            out[4 + 5 * k] = lamps[k].radius;
            out[5 + 5 * k] = lamps[k].excess;
        }
        put(out, 1 + 5 * MOST);
        return;
    }
    ok(ilf_sampler_slice(&slice, s, r, &err), &err);
    if (strcmp(what, "pdf") == 0) {
        const double pdf = slice ? ilf_pdf(slice, r + 3) : -1;
        put(&pdf, 1);
        return;
    }
    double out[6] = {0, 0, 0, -1, 0, 0};
    if (slice) {
        ilf_draw d;
        ilf_sample(&d, slice, r[3], r[4], r[5]);
        memcpy(out, d.dir, sizeof d.dir);
        out[3] = d.pdf;
        out[4] = d.far;
        out[5] = d.expected;
    }
    put(out, 6);
}

int main(int argc, char **argv)
{
    const int n = cli_parse(&prog, argc, argv);
    ilf_patches_spec spec = {0};
    ilf_patches *bright;
    ilf_sampler *s;
    ilf_error err;
    ilf *field;

    if (n != 2) cli_fail(CLI_USAGE, "expected what to do and one light field");
    const char *what = argv[1];
    const size_t size = strcmp(what, "lamps") == 0 ? 4 : 6;
    if (strcmp(what, "sample") && strcmp(what, "pdf") && strcmp(what, "lamps") && strcmp(what, "info"))
        cli_fail(CLI_USAGE, "%s: expected sample, pdf, lamps or info", what);
    ok(ilf_open(&field, argv[2], &err), &err);
    spec.mode = no_depth ? ILF_NO_DEPTH : ILF_DEPTH;
    spec.hit = box.there || sphere.there ? way_out : NULL;
    spec.cube = cube;
    spec.threshold = threshold;
    ok(ilf_patches_open(&bright, field, ilf_get_frame(field), &spec, &err), &err);
    ok(ilf_sampler_open(&s, bright, &err), &err);
    if (strcmp(what, "info") == 0) {
        printf("%.17g %lld\n", ilf_patches_threshold(bright), (long long)ilf_patches_count(bright));
    } else {
        double r[6];
        while (fread(r, sizeof *r, size, stdin) == size) one_record(what, bright, s, r);
    }
    ilf_sampler_close(s);
    ilf_patches_close(bright);
    ilf_close(field);
    return cli_end(CLI_OK);
}
