/*
 * beam.c - lamps that shine more into some directions: cos^k about an axis; and profile spotlights: a soft
 * ellipse in foot coordinates (logistic of a quadratic), sharp at a height that beta stands for.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lm.h"
#include "smooth.h"
#include "vec.h"

typedef struct job {
    const model *m;
    const lamp *l;
    const lightfield *f;
    int fold;
    double beta, mid[2], unit;
    double *base; /* per row and sample: what the masks so far let through */
} job;

static void set_base(job *j)
{
    ilf_luminaire b = j->l->s.l;

    b.nmasks = j->m->n, b.masks = (ilf_mask *)j->m->m[j->fold];
    for (int k = 0; k < j->l->nrows; k++)
        for (int q = 0; q < j->l->rows[k].n; q++)
            j->base[k * ROW_SAMPLES + q] =
                ilf_luminaire_pass(&b, j->f->pos[j->l->rows[k].probe], j->l->rows[k].dir[q]);
}

static void residuals(double *r, const ilf_mask *mask, const job *j)
{
    for (int k = 0; k < j->l->nrows; k++) {
        const row *w = &j->l->rows[k];
        double sum = 0;
        r[k] = 0;
        if (fold_of(j->f, w->probe) == j->fold) continue;
        for (int q = 0; q < w->n; q++)
            sum += j->base[k * ROW_SAMPLES + q] *
                   ilf_mask_pass(mask, j->l->s.l.centre, j->f->pos[w->probe], w->dir[q]);
        r[k] = sqrt(w->share) * (sum / w->n - w->value);
    }
}

/* p: axis' two slopes from straight at the plane's middle, log exponent, log gain */
static void beam_mask(ilf_mask *m, const double *p, const job *j)
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
    residuals(r, &m, context);
}

/* Foot coordinates' quadratic, from p in units of the plane's size about mid. */
static void gate_mask(ilf_mask *m, const double *p, const job *j)
{
    const double u = 1 / j->unit, x = j->mid[0], y = j->mid[1];
    const double a = p[3] * u * u, b = p[4] * u * u, c = p[5] * u * u, s = p[1] * u, t = p[2] * u;

    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_GATE, m->beta = j->beta;
    m->coef[0] = p[0] - s * x - t * y + a * x * x + b * x * y + c * y * y;
    m->coef[1] = s - 2 * a * x - b * y, m->coef[2] = t - b * x - 2 * c * y;
    m->coef[3] = a, m->coef[4] = b, m->coef[5] = c;
}

static void gate_residuals(double *r, const double *p, void *context)
{
    ilf_mask m;

    gate_mask(&m, p, context);
    residuals(r, &m, context);
}

int smooth_beam(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    job j = {.m = m, .l = l, .f = f, .base = malloc((size_t)l->nrows * ROW_SAMPLES * sizeof *j.base)};
    const double step[4] = {1e-3, 1e-3, 1e-2, 1e-3}, starts[3] = {1, 3, 4.5};
    double from[4] = {0};

    (void)pics;
    if (!j.base) return -1;
    for (int turn = 0; turn <= FOLDS; turn++) {
        double best = 1e30;
        j.fold = turn ? turn - 1 : ALL; /* all first: the folds start from there */
        set_base(&j);
        for (int s = 0; s < (turn ? 1 : 3); s++) {
            double p[4] = {0, 0, starts[s], 0};
            if (turn) memcpy(p, from, sizeof p);
            const double e = lm_fit(p, 4, l->nrows, beam_residuals, &j, step, 30);
            if (e < 0 || e >= best) continue;
            best = e;
            if (!turn) memcpy(from, p, sizeof p);
            beam_mask(&m->m[j.fold][m->n], p, &j);
        }
        if (best >= 1e30) return free(j.base), -1;
    }
    free(j.base);
    m->n++;
    model_judge(m, l, f);
    return 0;
}

/* Where the light falls: mean foot of bright rows, and their spread. */
static double bright_foot(job *j)
{
    double w = 0, s = 0;

    j->mid[0] = j->mid[1] = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < j->l->nrows; k++) {
            const row *r = &j->l->rows[k];
            const double *o = j->f->pos[r->probe], v = fmax(0, r->value) * r->share;
            if (!pass) w += v, j->mid[0] += v * o[0], j->mid[1] += v * o[1];
            else s += v * (pow(o[0] - j->mid[0] / w, 2) + pow(o[1] - j->mid[1] / w, 2));
        }
    if (w <= 0) return 0;
    j->mid[0] /= w, j->mid[1] /= w;
    return sqrt(s / w);
}

static double gate_once(double *p, job *j, double beta, int rounds)
{
    static const double step[6] = {1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3};

    j->beta = beta;
    return lm_fit(p, 6, j->l->nrows, gate_residuals, j, step, rounds);
}

/* beta of least misfit and its coefficients: a grid, then two halvings. */
static double gate_fit(double *p, double *beta, job *j, double radius)
{
    static const double grid[] = {-1, -.6, -.4, -.25, -.12, 0, .12, .25, .45, .8};
    double best = 1e30, span = .15 * lamp_beta(j->l, j->f);

    for (int i = 0; i < 10; i++)
        for (int soft = 0; soft < 2; soft++) {
            const double g = soft ? 4 : 12, r = radius / j->unit;
            double q[6] = {g, 0, 0, -g / (r * r), 0, -g / (r * r)};
            const double e = gate_once(q, j, lamp_beta(j->l, j->f) * grid[i], 25);
            if (e >= 0 && e < best) best = e, *beta = lamp_beta(j->l, j->f) * grid[i], memcpy(p, q, sizeof q);
        }
    for (int round = 0; round < 4; round++, span /= 2) {
        const double middle = *beta;
        for (int s = -1; s <= 1; s += 2) {
            double q[6];
            memcpy(q, p, sizeof q);
            const double b = middle + s * span * (middle < -.5 || middle > .4 ? 1 : .5),
                         e = gate_once(q, j, b, 15);
            if (e >= 0 && e < best) best = e, *beta = b, memcpy(p, q, sizeof q);
        }
    }
    return best;
}

int smooth_gate(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    job j = {.m = m,
             .l = l,
             .f = f,
             .unit = f->size,
             .base = malloc((size_t)l->nrows * ROW_SAMPLES * sizeof *j.base)};
    const double spread = bright_foot(&j);
    double p[6], beta = 0;

    (void)pics;
    if (!j.base) return -1;
    if (spread <= 0) return free(j.base), 1;
    j.fold = ALL;
    set_base(&j);
    if (gate_fit(p, &beta, &j, 1.3 * spread) >= 1e30) return free(j.base), -1;
    gate_once(p, &j, beta, 40);
    gate_mask(&m->m[ALL][m->n], p, &j);
    for (j.fold = 0; j.fold < FOLDS; j.fold++) {
        double q[6], b = beta, best;
        memcpy(q, p, sizeof q);
        set_base(&j);
        best = gate_once(q, &j, b, 30);
        for (int s = -1; s <= 1; s += 2) { /* beta is the fold's own, too */
            double t[6];
            memcpy(t, q, sizeof t);
            const double e = gate_once(t, &j, beta + s * .05 * lamp_beta(l, f), 20);
            if (e >= 0 && e < best) best = e, b = beta + s * .05 * lamp_beta(l, f), memcpy(q, t, sizeof t);
        }
        j.beta = b;
        gate_mask(&m->m[j.fold][m->n], q, &j);
    }
    free(j.base);
    m->n++;
    model_judge(m, l, f);
    return 0;
}
