/*
 * ilfcopy.c - test driver: a light field written anew, without the history that ilfpack adds, so that bytes can be compared.
 * ilfcopy IN OUT [--compression NAME] [--type NAME] [--interleave]; ilfcopy --digest IN prints its digest
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "ilf.h"

static const char *compression = "none", *type;
static int interleave, digest;
static const cli_opt opts[] = {
    {"compression", 'c', CLI_STRING, &compression, NULL, "NAME", "as ilfpack's"},
    {"type", 't', CLI_STRING, &type, NULL, "half|float", "as ilfpack's; default: the input's"},
    {"interleave", 0, CLI_FLAG, &interleave, NULL, NULL, "as ilfpack's"},
    {"digest", 0, CLI_FLAG, &digest, NULL, NULL, "print IN's digest, write nothing"},
    {0},
};
static const cli_prog prog = {"ilfcopy", "IN OUT", "Writes a light field anew.", opts, "", NULL};

int main(int argc, char **argv)
{
    const int argn = cli_parse(&prog, argc, argv);
    ilf_writer *w = NULL;
    ilf *field = NULL;
    ilf_error err;

    if (argn != (digest ? 1 : 2)) cli_fail(CLI_USAGE, "expected IN and OUT");
    if (ilf_open(&field, argv[1], &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    if (digest) {
        uint64_t number;
        if (ilf_digest(&number, field, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
        printf("%016llx\n", (unsigned long long)number);
        ilf_close(field);
        return cli_end(CLI_OK);
    }
    const ilf_info *in = ilf_get_info(field);
    ilf_spec s = {.n_u = in->n_u,
                  .n_v = in->n_v,
                  .n_theta = in->n_theta,
                  .n_phi = in->n_phi,
                  .polar_max = in->polar_max,
                  .polar_valid = in->polar_valid,
                  .type = !type                       ? in->type
                          : strcmp(type, "half") == 0 ? ILF_HALF
                                                      : ILF_FLOAT,
                  .compression = compression,
                  .interleave = interleave};
    for (int c = 0; c < 3; c++) {
        s.origin[c] = (double)in->origin[c];
        s.U[c] = (double)in->U[c];
        s.V[c] = (double)in->V[c];
    }
    ilf_notes notes;
    ilf_get_notes(&notes, field);
    s.comments = notes.comments, s.owner = notes.owner, s.cap_date = notes.cap_date;
    s.white_luminance = notes.white_luminance;
    s.lamps = ilf_get_luminaires(&s.n_lamps, field);
    float *rgb = malloc((size_t)in->n_theta * (size_t)in->n_phi * 3 * sizeof *rgb);
    if (!rgb) cli_fail(CLI_FAILED, "no memory");
    if (ilf_writer_open(&w, argv[2], &s, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    for (int k = 0; k < in->n_u * in->n_v; k++)
        if (ilf_read_probe(rgb, field, k % in->n_u, k / in->n_u, &err) != ILF_OK ||
            ilf_writer_probe(w, rgb, &err) != ILF_OK)
            cli_fail(CLI_FAILED, "%s", err.text);
    if (ilf_writer_close(w, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    free(rgb);
    ilf_close(field);
    return cli_end(CLI_OK);
}
