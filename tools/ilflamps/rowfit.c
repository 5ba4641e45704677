/*
 * rowfit.c - a lamp's rows against one more mask.
 */
#include "rowfit.h"

#include <stdlib.h>

#define DARK_ERROR .02 /* of a row that shows nothing */

double rowfit_softness(const lamp *l, const lightfield *f)
{
    const double apart =
        ilf_luminaire_extent(&l->s.l) * sqrt(3. * f->n / (1. + l->nrows) / ROW_SAMPLES); /* 3: about pi */

    return fmax(.28 * apart, 1e-4 * f->size);
}

int rowfit_make(rowfit *j, const model *m, const lamp *l, const lightfield *f)
{
    j->m = m, j->l = l, j->f = f;
    j->base = malloc(((size_t)l->nrows + 1) * ROW_SAMPLES * sizeof *j->base);
    if (!j->base) return -1;
    rowfit_fold(j, ALL);
    return 0;
}

void rowfit_free(rowfit *j)
{
    free(j->base);
    j->base = NULL;
}

void rowfit_fold(rowfit *j, int fold)
{
    ilf_luminaire b = j->l->s.l;

    j->fold = fold;
    b.nmasks = j->m->n, b.masks = (ilf_mask *)j->m->m[fold];
    for (int k = 0; k < j->l->nrows; k++)
        for (int q = 0; q < j->l->rows[k].n; q++)
            j->base[k * ROW_SAMPLES + q] =
                ilf_luminaire_pass(&b, j->f->pos[j->l->rows[k].probe], j->l->rows[k].dir[q]);
}

/* Rows of blurred pictures err by part of their light: what is dark is dark. */
static double trust(const row *r, const lamp *l)
{
    return 1 / hypot(1, l->scatter * r->value / DARK_ERROR);
}

void rowfit_residuals(double *r, const ilf_mask *mask, const rowfit *j)
{
    for (int k = 0; k < j->l->nrows; k++) {
        const row *w = &j->l->rows[k];
        double sum = 0;
        r[k] = 0;
        if (fold_of(j->f, w->probe) == j->fold) continue;
        for (int q = 0; q < w->n; q++)
            sum += j->base[k * ROW_SAMPLES + q] *
                   ilf_mask_pass(mask, j->l->s.l.centre, j->f->pos[w->probe], w->dir[q]);
        r[k] = trust(w, j->l) * sqrt(w->share) * (sum / w->n - w->value);
    }
}
