/*
 * ball.c - an opaque ball, four numbers, fitted to what the lamp's rows measured: where its shadow falls, how
 * large and how soft it is.
 */
#include "ball.h"

#include <string.h>

#include "lm.h"
#include "rowfit.h"
#include "vec.h"

enum { NUMBERS = 4, ROUNDS = 40 };

/* p: centre, log radius */
typedef struct job {
    rowfit fit;
    double soft; /* of rows (rowfit_softness) */
} job;

static double pass(const double *p, const double o[3], const double d[3], double lamp_z, double soft)
{
    double e[3];

    v_sub(e, p, o);
    const double t = v_dot(e, d);
    if (t <= 0 || o[2] + t * d[2] >= lamp_z) return 1;
    return 1 / (1 + exp((exp(p[3]) - sqrt(fmax(0, v_dot(e, e) - t * t))) / soft));
}

static void residuals(double *r, const double *p, void *context)
{
    const job *j = context;
    const lamp *l = j->fit.l;
    const double top = l->s.l.centre[2], soft = j->soft * fmin(1, fmax(.02, p[2] / top));

    for (int k = 0; k < l->nrows; k++) {
        const row *w = &l->rows[k];
        double sum = 0;
        r[k] = 0;
        if (fold_of(j->fit.f, w->probe) == j->fit.fold) continue;
        for (int q = 0; q < w->n; q++)
            sum += j->fit.base[k * ROW_SAMPLES + q] * pass(p, j->fit.f->pos[w->probe], w->dir[q], top, soft);
        r[k] = sqrt(w->share) * (sum / w->n - w->value);
    }
}

/* Middle of an outline on its sheet, and its mean distance from there. */
static int begin(double *p, const outline *o)
{
    double r = 0;

    memset(p, 0, NUMBERS * sizeof *p);
    for (int k = 0; k < o->n; k++)
        for (int c = 0; c < 2; c++) p[c] += o->at[k][c] / o->n;
    for (int k = 0; k < o->n; k++) r += hypot(o->at[k][0] - p[0], o->at[k][1] - p[1]) / o->n;
    p[2] = o->plane[0] + o->plane[1] * p[0] + o->plane[2] * p[1];
    if (!(r > 0)) return 1;
    p[3] = log(r);
    return 0;
}

static int versions(model *m, job *j, const double *from)
{
    const double h = 1e-4 * j->fit.f->size, step[NUMBERS] = {h, h, h, 1e-3};
    double best[NUMBERS];

    memcpy(best, from, sizeof best);
    for (int turn = 0; turn <= FOLDS; turn++) { /* all probes first: a fold begins where that ends */
        const int fold = turn ? turn - 1 : ALL;
        double p[NUMBERS];
        ilf_mask *mask = &m->m[fold][m->n];
        memcpy(p, best, sizeof p);
        rowfit_fold(&j->fit, fold);
        if (lm_fit(p, NUMBERS, j->fit.l->nrows, residuals, j, step, ROUNDS) < 0) return -1;
        if (!turn) memcpy(best, p, sizeof best);
        const double r = exp(p[3]);
        if (p[2] < r || p[2] + r > j->fit.l->s.l.centre[2] || r > j->fit.f->size) return 1;
        memset(mask, 0, sizeof *mask);
        mask->kind = ILF_MASK_BALL;
        memcpy(mask->coef, p, 3 * sizeof *p), mask->coef[3] = r;
    }
    m->height = best[2];
    m->n++;
    return 0;
}

int ball_fit(model *m, const lamp *l, const lightfield *f, const outline *from)
{
    job j = {.soft = rowfit_softness(l, f)};
    double p[NUMBERS];
    int bad = begin(p, from);

    if (!bad) bad = rowfit_make(&j.fit, m, l, f);
    if (!bad) bad = versions(m, &j, p);
    rowfit_free(&j.fit);
    if (bad) return bad;
    m->saw = 1;
    model_judge(m, l, f);
    m->blind = model_spread(m, l, f);
    return 0;
}
