/*
 * taken.c - the lamps that were taken out, as a file of version 2 holds them; and back.
 */
#include "taken.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "programs/field_guard.h"

void taken_first(analysis *a)
{
    for (int i = 0, n = 0; i < a->n; i++) {
        const found it = a->lamps[i];
        if (it.fate != TAKEN) continue;
        memmove(&a->lamps[n + 1], &a->lamps[n], (size_t)(i - n) * sizeof it);
        a->lamps[n++] = it;
    }
}

/* ---- to a file ------------------------------------------------------------------------------------ */

/* 0: not known. */
static double known(double error)
{
    return isfinite(error) && error > 0 && error < 1e30 ? error : 0;
}

static int one(ilf_luminaire *to, const found *it, const lightfield *f)
{
    *to = it->l.s.l;
    to->far = it->l.c.far;
    to->error_masks = known(it->best.error), to->error_interpolation = known(it->interpolation);
    to->error_position = known(it->l.c.sigma), to->error_radiance = known(it->l.s.sigma_radiance);
    to->seen = malloc((size_t)f->n * sizeof *to->seen);
    for (int k = 0; to->seen && k < f->n; k++) to->seen[k] = (float)it->l.seen[k];
    return to->seen ? 0 : -1;
}

ilf_luminaire *taken_lamps(int *n, const analysis *a)
{
    ilf_luminaire *l = calloc((size_t)a->n + 1, sizeof *l);
    int bad = !l;

    *n = 0;
    for (int i = 0; i < a->n && !bad; i++)
        if (a->lamps[i].fate == TAKEN) bad = one(&l[(*n)++], &a->lamps[i], &a->f);
    if (!bad) return l;
    taken_free(l, *n);
    return NULL;
}

void taken_free(ilf_luminaire *l, int n)
{
    for (int i = 0; l && i < n; i++) free(l[i].seen);
    free(l);
}

/* ---- from a file ---------------------------------------------------------------------------------- */

static int copy_masks(ilf_luminaire *to, const ilf_luminaire *from)
{
    to->nmasks = 0;
    to->masks = calloc((size_t)from->nmasks + 1, sizeof *to->masks);
    for (int k = 0; to->masks && k < from->nmasks; k++) {
        ilf_mask *m = &to->masks[k];
        *m = from->masks[k];
        if (m->grid) {
            const size_t bytes = mask_bytes(m);
            m->grid = malloc(bytes);
            if (!m->grid) return -1;
            memcpy(m->grid, from->masks[k].grid, bytes);
        }
        to->nmasks++;
    }
    return to->masks ? 0 : -1;
}

/* What its masks are, in words as choose.c has them. */
static void name_model(model *m, const ilf_luminaire *l)
{
    static const char *const NAMES[] = {"sheet", "smooth", "gate", "beam", "stack", "ball"};

    m->n = l->nmasks, m->name[0] = 0, m->error = l->error_masks;
    for (int k = 0; k < l->nmasks; k++) {
        const size_t n = strlen(m->name);
        const ilf_mask *mask = &l->masks[k];
        (void)!snprintf(m->name + n, sizeof m->name - n, "%s%s", n ? " x " : "",
                        mask->adds ? "remainder" : NAMES[mask->kind]);
        if (mask->kind == ILF_MASK_LAYER && m->height <= 0) m->height = mask->plane[0];
        if (mask->kind == ILF_MASK_STACK && m->height <= 0) m->height = mask->plane[0];
    }
}

static int take(found *it, const ilf_luminaire *l, const lightfield *f)
{
    it->fate = TAKEN, it->interpolation = l->error_interpolation;
    it->l.s.l = *l, it->l.s.l.seen = NULL, it->l.s.l.masks = NULL;
    it->l.s.radiance = ilf_luminance(l->rgb), it->l.s.sigma_radiance = l->error_radiance;
    memcpy(it->l.c.at, l->centre, sizeof it->l.c.at);
    it->l.c.far = l->far, it->l.c.sigma = l->error_position;
    name_model(&it->best, l);
    it->l.seen = malloc((size_t)f->n * sizeof *it->l.seen);
    if (!it->l.seen || copy_masks(&it->l.s.l, l)) return -1;
    for (int k = 0; k < f->n; k++) {
        it->l.seen[k] = l->seen ? (double)l->seen[k] : -1;
        it->l.c.seen += it->l.seen[k] > 0, it->l.s.full += it->l.seen[k] > .9;
        it->l.width = fmax(it->l.width, 2 * ilf_luminaire_cone(l, f->pos[k]));
    }
    return 0;
}

int taken_read(analysis *a, const char *path, errmsg *e)
{
    const ilf_luminaire *l;
    ilf_error err;
    ilf *file;
    int n, bad;

    memset(a, 0, sizeof *a);
    if (lf_read(&a->f, path, e)) return -1;
    if (field_open(&file, path, &err) != ILF_OK) {
        lf_free(&a->f);
        return err_set(e, "%s", err.text);
    }
    l = ilf_get_luminaires(&n, file);
    a->lamps = calloc((size_t)n + 1, sizeof *a->lamps);
    bad = a->lamps ? 0 : -1;
    for (; a->n < n && !bad; a->n++) bad = take(&a->lamps[a->n], &l[a->n], &a->f);
    field_close(file);
    if (!bad) return 0;
    analysis_free(a);
    return err_set(e, "%s: no memory for its lamps", path);
}
