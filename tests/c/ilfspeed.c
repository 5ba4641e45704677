/*
 * ilfspeed.c - test driver: what one lookup costs.  ilfspeed FILE [--lookups N]
 *
 * Prints CPU nanoseconds per lookup for three kinds of access, without and with depth correction, after one
 * pass that brings all probes into memory: "random" (a point on the plane and a direction anew for each),
 * "point" (one point, all directions) and "coherent" (neighbouring directions from one point, as a lamp's
 * candidates are).
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "base/cli.h"
#include "ilf.h"
#include "uniform.h"

static int lookups = 4000000;
static const cli_opt opts[] = {
    {"lookups", 'n', CLI_INT, &lookups, NULL, "N", "lookups of each kind (default 4000000)"},
    {0},
};
static const cli_prog prog = {"ilfspeed", "FILE", "Times lookups in a light field.", opts, "", NULL};

enum { RANDOM, POINT, COHERENT };

/* Rays from the plane to a sphere of radius r about its middle, prepared so that only lookups are timed. */
static void make_rays(double (*ray)[9], int n, int kind, const ilf_frame *fr)
{
    const double r = 4 * (fr->len_u + fr->len_v);
    double q[3] = {0.37, 0.61, 0}, theta = 0, z = 0.5;

    for (int k = 0; k < n; k++) {
        double *o = ray[k], *d = o + 3, *h = o + 6;
        if (kind == RANDOM) q[0] = uniform(), q[1] = uniform();
        if (kind != COHERENT || k % 4096 == 0)
            theta = 2 * 3.14159265358979324 * uniform(), z = 0.02 + 0.98 * uniform();
        const double t = theta + (kind == COHERENT ? 0.0004 * (k % 64) : 0),
                     c = z + (kind == COHERENT ? -1e-4 * (k / 64 % 64) : 0);
        const double s = sqrt(1 - c * c), a[3] = {s * cos(t), s * sin(t), c};
        for (int i = 0; i < 3; i++) {
            o[i] = fr->origin[i] + q[0] * fr->len_u * fr->u[i] + q[1] * fr->len_v * fr->v[i];
            d[i] = a[0] * fr->u[i] + a[1] * fr->v[i] + a[2] * fr->n[i];
            h[i] = o[i] + r * d[i];
        }
    }
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int argc, char **argv)
{
    static const char *const names[] = {"random", "point", "coherent"};
    const int argn = cli_parse(&prog, argc, argv);
    enum {
        BATCH = 1 << 12
    }; /* rays that stay in the cache: a renderer does not read them from memory either */
    double(*ray)[9] = malloc(BATCH * sizeof *ray), sum = 0;
    ilf_error err;
    ilf *field;

    if (argn != 1 || lookups < 1) cli_fail(CLI_USAGE, "expected one light field and lookups > 0");
    if (!ray) cli_fail(CLI_FAILED, "no memory");
    if (ilf_open(&field, argv[1], &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    const ilf_info *in = ilf_get_info(field);
    const ilf_frame *fr = ilf_get_frame(field);
    float *texels = malloc((size_t)in->n_theta * (size_t)in->n_phi * 3 * sizeof *texels);
    if (!texels) cli_fail(CLI_FAILED, "no memory");
    for (int k = 0; k < in->n_u * in->n_v; k++)
        if (ilf_read_probe(texels, field, k % in->n_u, k / in->n_u, &err) != ILF_OK)
            cli_fail(CLI_FAILED, "%s", err.text);
    free(texels);
    for (int mode = 0; mode < 2; mode++)
        for (int kind = RANDOM; kind <= COHERENT; kind++) {
            double best = HUGE_VAL;
            for (int round = 0; round < 3; round++) { /* the least of three: others use the machine too */
                double spent = 0;
                int done = 0;
                while (done < lookups) {
                    make_rays(ray, BATCH, kind, fr);
                    const double start = seconds();
                    for (int k = 0; k < BATCH; k++) {
                        float rgb[3];
                        if (ilf_eval(rgb, field, fr, ray[k], ray[k] + 3, ray[k] + 6,
                                     mode ? ILF_DEPTH : ILF_NO_DEPTH, &err) != ILF_OK)
                            cli_fail(CLI_FAILED, "%s", err.text);
                        sum += (double)rgb[1];
                    }
                    spent += seconds() - start;
                    done += BATCH;
                }
                best = fmin(best, spent / done);
            }
            printf("%s %s %.1f\n", mode ? "depth" : "nodepth", names[kind], best * 1e9);
        }
    fprintf(stderr, "(sum %g)\n", sum);
    free(ray);
    ilf_close(field);
    return cli_end(CLI_OK);
}
