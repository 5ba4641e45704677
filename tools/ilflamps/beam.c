/*
 * beam.c - lamps that shine more into some directions: cos^k about an axis.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lm.h"
#include "rowfit.h"
#include "smooth.h"
#include "vec.h"

/* p: axis' two slopes from straight at the plane's middle, log exponent, log gain */
static void beam_mask(ilf_mask *m, const double *p, const rowfit *j)
{
    double a[3] = {j->f->len_u / 2, j->f->len_v / 2, 0}, x[3], y[3];

    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_BEAM;
    v_sub(a, a, j->l->s.l.centre);
    v_unit(a), v_basis(x, y, a);
    for (int c = 0; c < 3; c++) m->coef[c] = a[c] + p[0] * x[c] + p[1] * y[c];
    v_unit(m->coef);
    m->coef[3] = exp(p[2]), m->coef[4] = exp(p[3]);
}

static void beam_residuals(double *r, const double *p, void *context)
{
    ilf_mask m;

    beam_mask(&m, p, context);
    rowfit_residuals(r, &m, context);
}

int smooth_beam(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    rowfit j;
    const double step[4] = {1e-3, 1e-3, 1e-2, 1e-3}, starts[3] = {1, 3, 4.5};
    double from[4] = {0};

    (void)pics;
    if (rowfit_make(&j, m, l, f)) return -1;
    for (int turn = 0; turn <= FOLDS; turn++) {
        double best = 1e30;
        rowfit_fold(&j, turn ? turn - 1 : ALL); /* all first: the folds start from there */
        for (int s = 0; s < (turn ? 1 : 3); s++) {
            double p[4] = {0, 0, starts[s], 0};
            if (turn) memcpy(p, from, sizeof p);
            const double e = lm_fit(p, 4, l->nrows, beam_residuals, &j, step, 30);
            if (e < 0 || e >= best) continue;
            best = e;
            if (!turn) memcpy(from, p, sizeof p);
            beam_mask(&m->m[j.fold][m->n], p, &j);
        }
        if (best >= 1e30) return rowfit_free(&j), -1;
    }
    rowfit_free(&j);
    m->n++;
    model_judge(m, l, f);
    m->blind = model_spread(m, l, f);
    return 0;
}
