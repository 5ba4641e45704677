/*
 * gate.c - profile spotlights: a soft ellipse in foot coordinates (logistic of a quadratic), sharp at a
 * height that beta stands for.
 *
 * In focus on the plane each probe is bright or dark, and many gates fit as well: the best one's edge is
 * needlessly hard, and somewhere between the probes.  So gates are drawn from all that fit (Metropolis), and
 * their mean is taken, as soft as the edges' places are unknown.  A gate is a circle unless rows say
 * otherwise.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lm.h"
#include "rowfit.h"
#include "smooth.h"
#include "vec.h"

enum { X, Y, LOG_R, LOG_S, LONG_X, LONG_XY, BETA, NUMBERS };
enum { SWEEPS = 500, SETTLING = 200, KEPT = 25 };
#define OVAL     .04  /* how far from a circle gates are: half the logarithm of the axes' ratio, rms */
#define NOISE    .02  /* of a probe's share, at least */
#define FINEST   .004 /* sizes of the plane: an edge is no harder */
#define LOGISTIC 1.81 /* standard deviation of an edge whose logistic has the scale 1 */

typedef struct job {
    rowfit fit;
    double beta, noise, unit; /* unit of beta */
} job;

/* p: middle, log radius, log steepness of the edge, how oval (along x, along the diagonal), beta */
static void gate_mask(ilf_mask *m, const double *p, double beta)
{
    const double r = exp(p[LOG_R]), k = .5 * exp(p[LOG_S]) / r, o = hypot(p[LONG_X], p[LONG_XY]);
    const double s = o > 1e-9 ? sinh(o) / o : 1, x = p[X], y = p[Y];
    const double a = k * (cosh(o) - s * p[LONG_X]), b = -k * s * p[LONG_XY],
                 c = k * (cosh(o) + s * p[LONG_X]);

    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_GATE, m->beta = beta;
    m->coef[0] = k * r * r - a * x * x - 2 * b * x * y - c * y * y;
    m->coef[1] = 2 * (a * x + b * y), m->coef[2] = 2 * (b * x + c * y);
    m->coef[3] = -a, m->coef[4] = -2 * b, m->coef[5] = -c;
}

static void gate_residuals(double *r, const double *p, void *context)
{
    const job *j = context;
    const int n = j->fit.l->nrows;
    ilf_mask m;

    gate_mask(&m, p, j->beta < 1e9 ? j->beta : p[BETA]);
    rowfit_residuals(r, &m, &j->fit);
    r[n] = NOISE / OVAL * p[LONG_X], r[n + 1] = NOISE / OVAL * p[LONG_XY];
}

/* Where the light falls: mean foot of bright rows, and their spread. */
static double bright_foot(double mid[2], const rowfit *j)
{
    double w = 0, s = 0;

    mid[0] = mid[1] = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < j->l->nrows; k++) {
            const row *r = &j->l->rows[k];
            const double *o = j->f->pos[r->probe], v = fmax(0, r->value) * r->share;
            if (!pass) w += v, mid[0] += v * o[0], mid[1] += v * o[1];
            else s += v * (pow(o[0] - mid[0] / w, 2) + pow(o[1] - mid[1] / w, 2));
        }
    if (w <= 0) return 0;
    mid[0] /= w, mid[1] /= w;
    return sqrt(s / w);
}

/* Least squares at a given beta, or with beta among the unknowns (NAN). */
static double once(double *p, job *j, double beta, int rounds)
{
    const double step[NUMBERS] = {1e-3, 1e-3, 1e-3, 1e-2, 1e-3, 1e-3, 1e-3};
    const int free_beta = isnan(beta);

    j->beta = free_beta ? 1e30 : beta;
    if (!free_beta) p[BETA] = beta;
    const double e =
        lm_fit(p, free_beta ? NUMBERS : BETA, j->fit.l->nrows + 2, gate_residuals, j, step, rounds);
    return e < 0 ? 1e30 : e;
}

/* The best of a grid of beta and two softnesses, then beta's own. */
static double best_fit(double *p, job *j, double radius, const double mid[2])
{
    static const double grid[] = {-1, -.6, -.4, -.25, -.12, 0, .12, .25, .45, .8};
    double best = 1e30;

    for (int i = 0; i < 10; i++)
        for (int soft = 0; soft < 2; soft++) {
            double q[NUMBERS] = {mid[0], mid[1], log(radius), log((soft ? 8 : 24) / radius)};
            const double e = once(q, j, j->unit * grid[i], 25);
            if (e < best) best = e, memcpy(p, q, sizeof q);
        }
    double q[NUMBERS];
    memcpy(q, p, sizeof q);
    const double e = best < 1e30 ? once(q, j, NAN, 40) : 1e30;
    if (e < best) best = e, memcpy(p, q, sizeof q);
    return best;
}

/* Knuth's MMIX generator (TAOCP 2, 3.3.4, table 1), upper bits. */
static double uniform(unsigned long long *seed)
{
    *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(*seed >> 11) / 9007199254740992.;
}

/* Minus twice the logarithm of how likely a gate is; huge where there is none. */
static double unlikely(double *r, const double *p, job *j)
{
    const double size = j->fit.f->size, radius = exp(p[LOG_R]), width = exp(-p[LOG_S]);
    double sum = 0;

    if (radius > 4 * size || radius < .02 * size || width < FINEST * size / LOGISTIC || width > radius)
        return 1e30;
    if (fabs(p[BETA]) > 1.5 * j->unit) return 1e30;
    gate_residuals(r, p, j);
    for (int k = 0; k < j->fit.l->nrows; k++) sum += r[k] * r[k] / (j->noise * j->noise);
    for (int k = 0; k < 2; k++) sum += pow(r[j->fit.l->nrows + k] / NOISE, 2);
    return sum;
}

/* Gates that fit about as well as p: a chain that begins there, number by number, with steps such that half
 * of the tries are taken.  kept: KEPT of them.  0; 1 where p is no gate; -1 without memory. */
static int draw(double (*kept)[NUMBERS], double *p, job *j)
{
    double step[NUMBERS] = {.01, .01, .02, .2, .03, .03, .02},
           *r = malloc((size_t)(j->fit.l->nrows + 2) * sizeof *r);
    unsigned long long seed = 12345;

    if (!r) return -1;
    j->beta = 1e30;
    p[LOG_S] = fmin(p[LOG_S], log(.9 * LOGISTIC / FINEST / j->fit.f->size));
    p[LOG_S] = fmax(p[LOG_S], .01 - p[LOG_R]);
    double now = unlikely(r, p, j);
    if (now >= 1e30) return free(r), 1; /* no spotlight: most of it lies elsewhere */
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (int k = 0; k < NUMBERS; k++) {
            double q[NUMBERS];
            memcpy(q, p, sizeof q);
            q[k] += step[k] * (2 * uniform(&seed) - 1);
            const double then = unlikely(r, q, j);
            const int taken = then < 1e30 && uniform(&seed) < exp(fmin(0, .5 * (now - then)));
            if (taken) now = then, memcpy(p, q, sizeof q);
            if (sweep < SETTLING) step[k] *= taken ? 1.15 : .87;
        }
        const int turn = (sweep - SETTLING) * KEPT / (SWEEPS - SETTLING);
        if (sweep >= SETTLING) memcpy(kept[turn], p, sizeof *kept);
    }
    free(r);
    return 0;
}

/* Variance of where the edge is, over directions from the middle. */
static double unsure_edge(const double (*kept)[NUMBERS], const double *mean)
{
    double sum = 0;

    for (int i = 0; i < KEPT; i++)
        for (int a = 0; a < 8; a++) {
            const double c = cos(a * .7854), s = sin(a * .7854);
            const double *k = kept[i],
                         off = (k[X] - mean[X]) * c + (k[Y] - mean[Y]) * s + exp(k[LOG_R]) - exp(mean[LOG_R]);
            sum += off * off / (8 * KEPT);
        }
    return sum;
}

/* The mean of gates drawn, as soft as they are apart. */
static void average(double *mean, const double (*kept)[NUMBERS])
{
    double width = 0;

    memset(mean, 0, NUMBERS * sizeof *mean);
    for (int i = 0; i < KEPT; i++) {
        for (int k = 0; k < NUMBERS; k++) mean[k] += kept[i][k] / KEPT;
        width += exp(-kept[i][LOG_S]) / KEPT;
    }
    mean[LOG_S] = -.5 * log(width * width + unsure_edge(kept, mean) / (LOGISTIC * LOGISTIC));
}

/* rms of what gates drawn differ by from the one taken, where no probe stands. */
static double apart(const ilf_mask *taken, const double (*kept)[NUMBERS], const lamp *l, const lightfield *f)
{
    const int points = l->scatter > 0 ? 1 : LAMP_POINTS; /* blurred pictures know its middle only */
    double sum = 0, o[3], d[3];

    for (int k = 0; k < PLACES; k++)
        for (int q = 0; q < points && model_place(o, k, l, f); q++) {
            model_line(d, o, q, l);
            const double v = ilf_mask_pass(taken, l->s.l.centre, o, d);
            for (int i = 0; i < KEPT; i++) {
                ilf_mask m;
                gate_mask(&m, kept[i], kept[i][BETA]);
                sum += pow(ilf_mask_pass(&m, l->s.l.centre, o, d) - v, 2);
            }
        }
    return sqrt(sum / (PLACES * points * KEPT));
}

/* All five versions from the best fit. */
static int versions(model *m, job *j, const double *best)
{
    double kept[KEPT][NUMBERS], mean[NUMBERS];

    for (int s = 0; s <= FOLDS; s++) {
        ilf_mask *mask = &m->m[s][m->n];
        double p[NUMBERS];
        memcpy(p, best, sizeof p);
        rowfit_fold(&j->fit, s);
        const int r = draw(kept, p, j);
        if (r) return r;
        average(mean, kept);
        gate_mask(mask, mean, mean[BETA]);
        if (s == ALL) m->blind = apart(mask, kept, j->fit.l, j->fit.f);
    }
    return 0;
}

int smooth_gate(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    job j = {.unit = lamp_beta(l, f)};
    double p[NUMBERS], mid[2];
    int bad = 0;

    (void)pics;
    if (rowfit_make(&j.fit, m, l, f)) return -1;
    const double spread = bright_foot(mid, &j.fit),
                 e = spread > 0 ? best_fit(p, &j, 1.3 * spread, mid) : 1e30;
    if (e >= 1e30) return rowfit_free(&j.fit), 1;
    j.noise = fmax(NOISE, sqrt(e / f->n));
    bad = versions(m, &j, p);
    rowfit_free(&j.fit);
    if (bad) return bad;
    m->n++;
    model_judge(m, l, f);
    return 0;
}
