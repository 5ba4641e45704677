/*
 * ilfboth.c - test driver: the lookup of usual rays against that of any ray, and two files against each
 * other. ilfboth FILE [OTHER] [--rays N]
 *
 * Prints the number of rays that the fast lookup took, and the largest difference between the two as a part
 * of the value (texels are not to be negative).  With OTHER it prints how
 * many values differ in any bit from that file's: the same light in another order.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/cli.h"
#include "ilf_internal.h"
#include "uniform.h"

static int rays = 100000;
static const cli_opt opts[] = {{"rays", 'n', CLI_INT, &rays, NULL, "N", "rays (default 100000)"}, {0}};
static const cli_prog prog = {"ilfboth", "FILE [OTHER]", "Compares lookups.", opts, "", NULL};

/* About the plane, in all directions; one in eight of another size, parallel, on the plane, on a probe, or at
 * the seam. */
static void make_ray(double o[3], double d[3], double h[3], const ilf_frame *fr)
{
    const int odd = (int)(64 * uniform());
    const double z = uniform(), th = 2 * ILF_PI * uniform(), s = sqrt(1 - z * z),
                 reach = (fr->len_u + fr->len_v) * pow(10, 2 * uniform() - 1);
    double a[3] = {s * cos(th), s * sin(th), z}, q[2] = {1.4 * uniform() - 0.2, 1.4 * uniform() - 0.2};

    if (odd == 0) a[2] = 1e-12;
    if (odd == 1) a[0] = a[1] = 0;
    if (odd == 2) a[1] = 0, a[0] = -1;
    if (odd == 3) q[0] = q[1] = 0;
    if (odd == 4) a[2] = -a[2];
    if (odd == 5) a[1] = 1e-9 * (uniform() - 0.5), a[0] = -1;
    for (int c = 0; c < 3; c++) {
        o[c] = fr->origin[c] + q[0] * fr->len_u * fr->u[c] + q[1] * fr->len_v * fr->v[c];
        d[c] = a[0] * fr->u[c] + a[1] * fr->v[c] + a[2] * fr->n[c];
        h[c] = odd == 6 ? o[c] : o[c] + reach * d[c];
        if (odd == 7) d[c] *= 1e-200;
    }
}

int main(int argc, char **argv)
{
    const int argn = cli_parse(&prog, argc, argv);
    ilf *f[2] = {NULL, NULL};
    long fast = 0, differ = 0;
    double worst = 0;
    ilf_error err;

    if (argn < 1 || argn > 2) cli_fail(CLI_USAGE, "expected one or two light fields");
    for (int k = 0; k < argn; k++)
        if (ilf_open(&f[k], argv[1 + k], &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    /* not the file's plane: turned, it would make grazing rays' places a matter of rounding */
    static const double zero[3] = {0, 0, 0}, U[3] = {2, 0, 0}, V[3] = {0, 1.5, 0};
    ilf_frame plane;
    const ilf_frame *fr = &plane;
    if (ilf_frame_init(&plane, zero, U, V, NULL, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    for (int k = 0; k < rays; k++)
        for (int mode = 0; mode < 3; mode++) {
            double o[3], d[3], h[3];
            float a[3], b[3], c[3] = {0, 0, 0};

            make_ray(o, d, h, fr);
            const double *hit = mode == 2 ? NULL : h;
            const ilf_mode how = mode == 1 ? ILF_NO_DEPTH : ILF_DEPTH;
            if (f[0]->fast[0])
                fast += f[0]->fast[mode == 0](c, f[0], fr, hit ? h : o, d, &err) != ILF_UNUSUAL;
            if (ilf_eval(a, f[0], fr, o, d, hit, how, &err) != ILF_OK ||
                ilf_eval_plain(b, f[0], fr, o, d, hit, how, &err) != ILF_OK ||
                (f[1] && ilf_eval(c, f[1], fr, o, d, hit, how, &err) != ILF_OK))
                cli_fail(CLI_FAILED, "%s", err.text);
            if (f[1]) differ += memcmp(a, c, sizeof a) != 0;
            for (int i = 0; i < 3; i++)
                if (b[i] > 0) worst = fmax(worst, fabs((double)a[i] / (double)b[i] - 1));
        }
    printf("fast %ld of %ld\nworst %.3g\n", fast, 3L * rays, worst);
    if (f[1]) printf("differ %ld\n", differ);
    ilf_close(f[0]);
    ilf_close(f[1]);
    return cli_end(CLI_OK);
}
