/*
 * repack.c - see repack.h.  One probe after the other: a field need not fit into memory.
 */
#include "repack.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "base/outfile.h"
#include "ilflamps/rounding.h"
#include "image/image.h"
#include "programs/field_guard.h"

enum { MEMORY = 64 << 20 }; /* for decoded probes that are read once */

int repack_is_field(const char *path)
{
    const img_open_opts how = {.keep_aspect = 1};
    img_reader *r;
    errmsg err;
    char version[64];

    if (img_reader_open_as(&r, path, &how, &err) != 0) return 0;
    const int is = img_reader_fact(r, "ilf:version", version, sizeof version);
    img_reader_close(r);
    return is;
}

static ilf_spec spec_of(const repackplan *p, const ilf *field, const ilf_notes *notes)
{
    const ilf_info *in = ilf_get_info(field);
    ilf_spec s = {.n_u = in->n_u,
                  .n_v = in->n_v,
                  .n_theta = in->n_theta,
                  .n_phi = in->n_phi,
                  .polar_max = in->polar_max,
                  .type = in->type,
                  .compression =
                      p->compression ? p->compression : rounding_compression(p->tolerance, p->interleave),
                  .interleave = p->interleave,
                  .owner = notes->owner,
                  .cap_date = notes->cap_date,
                  .white_luminance = notes->white_luminance,
                  .name = p->target,
                  .tolerance = p->tolerance};

    for (int k = 0; k < 3; k++)
        s.origin[k] = (double)in->origin[k], s.U[k] = (double)in->U[k], s.V[k] = (double)in->V[k];
    if (in->polar_valid < in->polar_max) s.polar_valid = in->polar_valid;
    if (p->type) s.type = strcmp(p->type, "half") == 0 ? ILF_HALF : ILF_FLOAT;
    s.lamps = ilf_get_luminaires(&s.n_lamps, field);
    return s;
}

static int copy_probes(ilf_writer *w, const ilf *field, float *rgb, errmsg *e)
{
    const ilf_info *in = ilf_get_info(field);
    ilf_error err;

    for (int j = 0; j < in->n_v; j++)
        for (int i = 0; i < in->n_u; i++) {
            if (ilf_read_probe(rgb, field, i, j, &err) != ILF_OK || ilf_writer_probe(w, rgb, &err) != ILF_OK)
                return err_set(e, "%s", err.text);
            cli_progress("packing", (double)j * in->n_u + i + 1, (double)in->n_u * in->n_v);
        }
    return ilf_check_unchanged(field, &err) == ILF_OK ? 0 : err_set(e, "%s", err.text);
}

static int write_field(const ilf_spec *spec, const ilf *field, errmsg *e)
{
    float *rgb = malloc((size_t)spec->n_theta * (size_t)spec->n_phi * 3 * sizeof *rgb);
    ilf_writer *w = NULL;
    outfile *o = NULL;
    ilf_error err;
    int bad = rgb ? out_begin(&o, spec->name, e) : err_set(e, "%s: no memory for a probe", spec->name);

    if (!bad && ilf_writer_open(&w, out_path(o), spec, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    if (!bad && (bad = copy_probes(w, field, rgb, e)) != 0) ilf_writer_abort(w);
    else if (!bad && ilf_writer_close(w, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    free(rgb);
    if (!bad) return out_commit(o, e);
    if (o) out_abort(o);
    return -1;
}

/* The old comments and the command line below them. */
static char *history(const char *before, const char *line)
{
    const size_t room = (before ? strlen(before) + 1 : 0) + strlen(line) + 1;
    char *text = malloc(room);

    if (text) (void)!snprintf(text, room, "%s%s%s", before ? before : "", before ? "\n" : "", line);
    return text;
}

int repack(const repackplan *p, int dry, errmsg *e)
{
    ilf_loss loss = {0};
    ilf_notes notes;
    ilf_error err;
    ilf *field;

    if (field_open(&field, p->source, &err) != ILF_OK) return err_set(e, "%s", err.text);
    (void)ilf_set_memory(field, MEMORY, NULL); /* without it, all stays in memory */
    ilf_get_notes(&notes, field);
    ilf_spec spec = spec_of(p, field, &notes);
    char *comments = history(notes.comments, p->line);
    spec.comments = comments, spec.loss = &loss;
    int bad = comments ? 0 : err_set(e, "%s: no memory for its comments", p->target);
    if (!bad && ilf_spec_check(&spec, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    if (!bad && !dry) bad = write_field(&spec, field, e);
    if (!bad && !dry && p->tolerance > 0) rounding_say(&loss, p->target, spec.n_lamps > 0);
    free(comments);
    field_close(field);
    return bad;
}
