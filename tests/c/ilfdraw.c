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
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "ilf.h"

enum { MOST = 8 };

static int no_depth;
static double cube, threshold;
static double box[6], sphere[4], ball[4];
static int has_box, has_sphere, has_ball;

static int take_box(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    has_box = 1;
    return cli_parse_doubles(box, 6, value, ", ", e);
}

static int take_sphere(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    has_sphere = 1;
    return cli_parse_doubles(sphere, 4, value, ", ", e);
}

static int take_ball(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    has_ball = 1;
    return cli_parse_doubles(ball, 4, value, ", ", e);
}

static const cli_opt opts[] = {
    {"nodepth", 0, CLI_FLAG, &no_depth, NULL, NULL, "lookups without depth correction"},
    {"box", 0, CLI_CALL, NULL, take_box, "X0,Y0,Z0,X1,Y1,Z1",
     "auxiliary geometry: the box between two corners, from inside"},
    {"sphere", 0, CLI_CALL, NULL, take_sphere, "X,Y,Z,R", "auxiliary geometry: a sphere, from inside"},
    {"ball", 0, CLI_CALL, NULL, take_ball, "X,Y,Z,R", "a ball within the box or sphere"},
    {"cube", 0, CLI_DOUBLE, &cube, NULL, "E", "edge of the cubes of space (default: the library's)"},
    {"threshold", 0, CLI_DOUBLE, &threshold, NULL, "T",
     "luminance that counts as bright (default: the library's)"},
    {0},
};
static const cli_prog prog = {"ilfdraw", "sample|pdf|lamps|info FILE", "Draws from a light field's sampler.",
                              opts, ""};

/* Where a ray goes into (side -1) or out of (side 1) a sphere; infinity if it misses. */
static double cross_sphere(const double o[3], const double d[3], const double s[4], int side)
{
    double a = 0, b = 0, c = -s[3] * s[3];

    for (int k = 0; k < 3; k++) {
        const double w = o[k] - s[k];
        a += d[k] * d[k];
        b += w * d[k];
        c += w * w;
    }
    const double disc = b * b - a * c;
    return disc > 0 ? (-b + side * sqrt(disc)) / a : HUGE_VAL;
}

/* The ball, or the way out of the box or sphere along a ray; 0 for a ray that starts outside and misses. */
static int way_out(double hit[3], const double o[3], const double d[3], void *context)
{
    double t = HUGE_VAL;

    (void)context;
    if (has_sphere) t = cross_sphere(o, d, sphere, 1);
    else
        for (int k = 0; k < 3; k++) {
            if (d[k] == 0) continue;
            const double at = ((d[k] > 0 ? box[3 + k] : box[k]) - o[k]) / d[k];
            if (at < t) t = at;
        }
    if (has_ball) {
        const double at = cross_sphere(o, d, ball, -1);
        if (at > 0 && at < t) t = at;
    }
    if (!(t > 0 && isfinite(t))) return 0;
    for (int k = 0; k < 3; k++) hit[k] = o[k] + t * d[k];
    return 1;
}

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
    spec.hit = has_box || has_sphere ? way_out : NULL;
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
