/*
 * shrink_words.h - for ilfinfo: what a light field would shrink to, from a few of its probes written to memory.
 */
#ifndef SHRINK_WORDS_H
#define SHRINK_WORDS_H

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/cli.h"
#include "ilf.h"

enum { SHRINK_PROBES = 9 };

/* Probes spread over the grid, row after row. */
static int shrink_probe(int k, int n, int all)
{
    return n > 1 ? (int)((double)k * (all - 1) / (n - 1) + .5) : 0;
}

/* Bytes of n probes as a file of their own, that nobody sees. */
static double shrink_bytes(const ilf *field, int n, double tolerance)
{
    const ilf_info *in = ilf_get_info(field);
    const int all = in->n_u * in->n_v, fd = memfd_create("ilfinfo", MFD_CLOEXEC);
    ilf_spec spec = {.n_u = n,
                     .n_v = 1,
                     .n_theta = in->n_theta,
                     .n_phi = in->n_phi,
                     .U = {1, 0, 0},
                     .V = {0, 1, 0},
                     .polar_max = in->polar_max,
                     .type = in->type,
                     .compression = "zip",
                     .tolerance = tolerance,
                     .name = ilf_get_path(field)};
    float *rgb = malloc((size_t)in->n_theta * (size_t)in->n_phi * 3 * sizeof *rgb);
    char path[64];
    ilf_writer *w;
    ilf_error err;

    (void)!snprintf(path, sizeof path, "/dev/fd/%d", fd);
    if (fd < 0 || !rgb) cli_fail(CLI_FAILED, "%s: no memory for a probe", spec.name);
    if (ilf_writer_open(&w, path, &spec, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    for (int k = 0; k < n; k++) {
        const int q = shrink_probe(k, n, all);
        if (ilf_read_probe(rgb, field, q % in->n_u, q / in->n_u, &err) != ILF_OK ||
            ilf_writer_probe(w, rgb, &err) != ILF_OK)
            cli_fail(CLI_FAILED, "%s", err.text);
    }
    if (ilf_writer_close(w, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    const double bytes = (double)lseek(fd, 0, SEEK_END);
    close(fd);
    free(rgb);
    return bytes;
}

static void print_shrunk(const ilf *field, const char *what, double tolerance, const char *how)
{
    const ilf_info *in = ilf_get_info(field);
    const int all = in->n_u * in->n_v, n = all < SHRINK_PROBES ? all : SHRINK_PROBES;
    const double raw = (double)in->n_theta * in->n_phi * (in->type == ILF_HALF ? 6 : 12) * all;
    const double bytes = shrink_bytes(field, n, tolerance) / n * all;

    printf("%-13s about %.3g MB, %.3g of its texels as they are (%s)\n", what, bytes * 1e-6, bytes / raw,
           how);
}

static void print_shrink(const ilf *field)
{
    print_shrunk(field, "zipped", 0, "ilfpack -c zip");
    print_shrunk(field, "rounded", .01, "ilfpack --tolerance 1%: texels within 1 %");
}

#endif
