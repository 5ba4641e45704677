/*
 * output.c - the light field with its lamps taken out, as a file of version 2.
 */
#include "output.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "programs/field_guard.h"
#include "rounding.h"
#include "taken.h"

static const float MOST_HALF = 65504.f;

static int fits_half(const lightfield *f)
{
    const size_t n = (size_t)f->n * (size_t)f->np * (size_t)f->nt * 3;

    for (size_t k = 0; k < n; k++)
        if (fabsf(f->rgb[k]) > MOST_HALF) return 0;
    return 1;
}

static const char *compression_of(const storage *s)
{
    return s->compression ? s->compression : rounding_compression(s->tolerance, s->interleave);
}

static ilf_spec spec_of(const storage *s, const lightfield *f)
{
    ilf_spec spec = lf_spec(f);

    spec.type = s->type ? (strcmp(s->type, "half") == 0 ? ILF_HALF : ILF_FLOAT)
                        : (fits_half(f) ? ILF_HALF : ILF_FLOAT);
    spec.compression = compression_of(s), spec.interleave = s->interleave, spec.tolerance = s->tolerance;
    return spec;
}

int storage_check(const storage *s, errmsg *e)
{
    /* any grid will do */
    const ilf_spec spec = {.n_u = 1,
                           .n_v = 1,
                           .n_theta = 8,
                           .n_phi = 4,
                           .U = {1, 0, 0},
                           .V = {0, 1, 0},
                           .polar_max = 1,
                           .compression = compression_of(s),
                           .interleave = s->interleave,
                           .name = "-o"};
    ilf_error err;

    if (s->type && strcmp(s->type, "half") != 0 && strcmp(s->type, "float") != 0)
        return err_set(e, "--type: expected half or float, found %s", s->type);
    return ilf_spec_check(&spec, &err) == ILF_OK ? 0 : err_set(e, "%s", err.text);
}

/* What was said of the input, and this command line below it; NULL without memory. */
static char *history(const char *before, const char *line)
{
    const size_t room = (before ? strlen(before) + 1 : 0) + strlen(line) + 1;
    char *text = malloc(room);

    if (text) (void)!snprintf(text, room, "%s%s%s", before ? before : "", before ? "\n" : "", line);
    return text;
}

static int write_file(const char *path, const lightfield *f, const ilf_spec *spec, errmsg *e)
{
    outfile *o = NULL;

    if (out_begin(&o, path, e)) return -1;
    if (lf_write_as(f, out_path(o), spec, e)) {
        out_abort(o);
        return -1;
    }
    return out_commit(o, e);
}

/* What coarse probes measured of lamps: as the probe beside each did. */
static void seen_by(ilf_luminaire *lamps, int n, const fewer *w)
{
    for (int i = 0; i < n; i++) {
        float *seen = malloc((size_t)w->f.n * sizeof *seen);
        for (int k = 0; seen && lamps[i].seen && k < w->f.n; k++) seen[k] = lamps[i].seen[w->nearest[k]];
        free(lamps[i].seen);
        lamps[i].seen = seen;
    }
}

/* The probes that are to be written: *w's, or all. */
static const lightfield *probes(fewer *w, const analysis *a, const storage *s, const char *path, errmsg *e)
{
    if (!s->fewer) return &a->f;
    if (fewer_find(w, a, &s->few, e)) return NULL;
    fewer_say(w, &s->few, &a->f, path);
    return w->same ? &a->f : &w->f;
}

int output_write(const char *path, const char *input, const analysis *a, const storage *s, const char *line,
                 int *lamps, errmsg *e)
{
    fewer w = {0};
    ilf_loss loss = {0};
    ilf_luminaire *l = taken_lamps(lamps, a);
    ilf_error err;
    ilf_notes notes;
    ilf *file = NULL;
    const lightfield *f = l ? probes(&w, a, s, path, e) : NULL;
    int bad = f ? 0 : l ? -1 : err_set(e, "%s: no memory for its lamps", path);

    if (!bad && field_open(&file, input, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    if (!bad) ilf_get_notes(&notes, file);
    char *comments = bad ? NULL : history(notes.comments, line);
    if (!bad && !comments) bad = err_set(e, "%s: no memory for its comments", path);
    if (!bad) {
        ilf_spec spec = spec_of(s, f);
        if (f == &w.f) seen_by(l, *lamps, &w);
        spec.owner = notes.owner, spec.cap_date = notes.cap_date;
        spec.white_luminance = notes.white_luminance;
        spec.comments = comments, spec.lamps = l, spec.n_lamps = *lamps, spec.name = path;
        spec.loss = &loss;
        bad = write_file(path, f, &spec, e);
        if (!bad && spec.tolerance > 0) rounding_say(&loss, path, *lamps > 0);
    }
    fewer_free(&w);
    free(comments);
    field_close(file);
    taken_free(l, *lamps);
    return bad;
}
