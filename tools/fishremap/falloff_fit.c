/*
 * falloff_fit.c - penalised, monotone fit of a falloff curve, averaged over what it could be (falloff_fit.h).
 *
 * The curve is a Gaussian process on the nodes whose third differences are independent, of variance s^2 /
 * (lambda w_k); w falls towards the rim by one of three laws, since a lens that vignettes bends there a
 * hundred times as hard as in the middle.  Each (lambda, law) has a marginal likelihood (REML: Patterson &
 * Thompson 1971; as a smoothing spline's: Wahba 1985), and what is written is the mean over all of them, by
 * those: its deviation is that of the curves and that between them.
 *
 * The monotone problem is least squares with signs: with steps s_k = g_k - g_(k+1) >= 0 and a level
 * that is shifted far above 0 all unknowns are >= 0, which nnls.h solves exactly.
 */
#include "falloff_fit.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "falloff_outliers.h"
#include "nnls.h"

#define N        FIT_NODES
#define SHIFT    64.0 /* log units above anything that occurs */
#define LAWS     3
#define LEAST_SD 1e-4 /* no reading is better */

/* Row of the data matrix: cubic (Lagrange, even about 0) interpolation between nodes. */
static void basis(double row[N], double t)
{
    int k = (int)t;
    if (k > N - 2) k = N - 2;
    if (k < 0) k = 0;
    int k0 = k - 1 > N - 4 ? N - 4 : k - 1;
    double s = t - k0, c[4] = {-(s - 1) * (s - 2) * (s - 3) / 6, s * (s - 2) * (s - 3) / 2,
                               -s * (s - 1) * (s - 3) / 2, s * (s - 1) * (s - 2) / 6};
    memset(row, 0, sizeof(double) * N);
    for (int i = 0; i < 4; i++) row[abs(k0 + i)] += c[i];
}

/* Row k of the third difference about node k - 1/2 ... even about the axis. */
static void third(double row[N], int k)
{
    static const double c[4] = {-1, 3, -3, 1};
    memset(row, 0, sizeof(double) * N);
    for (int i = 0; i < 4; i++) row[abs(k - 1 + i)] += c[i];
}

#define NPEN (N - 2) /* k = 0 .. N-3 */

/* One (lambda, law): the posterior of the curve, given the readings. */
typedef struct posterior {
    double lambda;
    int law;
    double g[N], inv[N][N]; /* mean, and covariance in units of variance */
    double sum;             /* weighted squares, penalty included */
    double freedom, score;  /* trace of the smoother; -2 log of the marginal likelihood */
} posterior;

/* How stiff the curve is at third difference k, law 0: alike everywhere; 1 and 2: over the last third of the
 * field its deviation grows to 6 and 40 times. */
static double stiffness(int law, int k)
{
    static const double most[LAWS] = {1, 6, 40};
    double t = ((double)k - 0.5) / (N - 1), s = fmin(fmax((t - 0.6) / 0.4, 0), 1);
    return pow(most[law], -2 * s);
}

/* A = sum w b b' + lambda D'WD, by Cholesky: N is small and the penalty keeps the condition in hand. */
static int solve(posterior *p, const fit_data *d, double lambda, int law)
{
    static const double ridge = 1e-12;
    double a[N][N], row[N], logs = 0;
    int n = 0;
    memset(a, 0, sizeof a);
    p->lambda = lambda, p->law = law;
    memset(p->g, 0, sizeof p->g);
    for (int i = 0; i < d->n; i++) {
        if (!d->in[i]) continue;
        const double *b = d->row[i];
        n++;
        for (int j = 0; j < N; j++) {
            if (b[j] == 0) continue;
            p->g[j] += b[j] * d->y[i];
            for (int q = 0; q < N; q++) a[j][q] += b[j] * b[q];
        }
    }
    for (int k = 0; k < NPEN; k++) {
        double w = lambda * stiffness(law, k);
        third(row, k);
        logs -= log(w);
        for (int j = 0; j < N; j++)
            for (int q = 0; row[j] != 0 && q < N; q++) a[j][q] += w * row[j] * row[q];
    }
    for (int j = 0; j < N; j++) a[j][j] += ridge;
    if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', N, &a[0][0], N)) return -1;
    for (int j = 0; j < N; j++) logs += 2 * log(a[j][j]);
    if (LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', N, 1, &a[0][0], N, p->g, 1)) return -1;
    if (LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'L', N, &a[0][0], N)) return -1;
    for (int j = 0; j < N; j++)
        for (int q = 0; q < N; q++) p->inv[j][q] = a[j > q ? j : q][j > q ? q : j];
    p->sum = p->freedom = 0;
    for (int i = 0; i < d->n; i++) {
        if (!d->in[i]) continue;
        double r = d->y[i] - fit_predict(p->g, d->row[i]);
        p->sum += r * r;
        p->freedom += fit_variance(p->inv, d->row[i]);
    }
    for (int k = 0; k < NPEN; k++) {
        double v = 0;
        third(row, k);
        for (int j = 0; j < N; j++) v += row[j] * p->g[j];
        p->sum += lambda * stiffness(law, k) * v * v;
    }
    /* beside the level and the bend that no penalty holds, n - 2 numbers tell of the noise; and it is a
     * prior's two that none is 0 */
    p->score = logs + (n - 2) * log(p->sum + 2 * LEAST_SD * LEAST_SD);
    return 0;
}

double fit_predict(const double g[N], const double row[N])
{
    double v = 0;
    for (int k = 0; k < N; k++) v += row[k] * g[k];
    return v;
}

double fit_variance(const double (*inv)[N], const double row[N])
{
    double s = 0;
    for (int j = 0; j < N; j++)
        for (int q = 0; row[j] != 0 && q < N; q++) s += row[j] * inv[j][q] * row[q];
    return s;
}

static int count_in(const fit_data *d)
{
    int n = 0;
    for (int i = 0; i < d->n; i++) n += d->in[i];
    return n;
}

/* What n readings can bear, and what a lens can have: rings of a flat field are many, and their deviations
 * are not independent. */
static double most_freedom(int n)
{
    return fmax(fmin(fmin(n - 1.2, 2 + 0.6 * n), 14), 1.5);
}

/* All posteriors of one law or, with law < 0, of all; each to be had by call(p, arg). */
static int each(const fit_data *d, int law, int (*call)(const posterior *p, void *arg), void *arg)
{
    posterior *p = malloc(sizeof *p);
    const double most = most_freedom(count_in(d));
    int rc = p ? 0 : -1;
    for (int l = law < 0 ? 0 : law; !rc && l < (law < 0 ? LAWS : law + 1); l++)
        for (int k = 0; !rc && k <= 34; k++) {
            if (solve(p, d, pow(10, 9 - 0.4 * k), l)) break; /* too weak for the numbers */
            if (k && p->freedom > most) break;
            rc = call(p, arg);
        }
    free(p);
    return rc;
}

static int keep_best(const posterior *p, void *arg)
{
    posterior *best = arg;
    if (p->score < best->score) *best = *p;
    return 0;
}

/* ---- what the outliers' judge asks ------------------------------------------------------------------- */

int fit_deleted(double *t, double *off, const fit_data *d)
{
    posterior *p = malloc(sizeof *p);
    const int n = count_in(d);
    int rc = p ? 0 : -1;
    for (int i = 0; i < d->n; i++) t[i] = INFINITY;
    for (int law = 0; !rc && law < LAWS; law++) {
        p->score = INFINITY;
        rc = each(d, law, keep_best, p);
        for (int i = 0; !rc && isfinite(p->score) && i < d->n; i++) {
            double r = d->y[i] - fit_predict(p->g, d->row[i]), h = fit_variance(p->inv, d->row[i]), e, left;
            if (d->in[i]) { /* as if it were not there: the exact leave-one-out at this lambda */
                e = r / fmax(1 - h, 1e-6), left = (p->sum - r * e) / fmax(n - 3, 1);
                left = fmax(left, FIT_LEAST_NOISE * FIT_LEAST_NOISE) / fmax(1 - h, 1e-6);
            } else {
                e = r, left = fmax(p->sum / fmax(n - 2, 1), FIT_LEAST_NOISE * FIT_LEAST_NOISE) * (1 + h);
            }
            double q = e / sqrt(left);
            if (fabs(q) < fabs(t[i])) t[i] = q, off[i] = e;
        }
    }
    free(p);
    return rc;
}

/* ---- the average ------------------------------------------------------------------------------------- */

typedef struct average {
    int n;            /* readings */
    double best, sum; /* the best score; of weights */
    double g[N], second[N][N], freedom, variance;
} average;

static double noise(const posterior *p, int n)
{
    double v = n > 2 ? p->sum / (n - 2) : 0;
    v = fmax(v, LEAST_SD * LEAST_SD);
    return n < 4 ? fmax(v, 2.5e-5) : v; /* three points can't show their own scatter */
}

static int add(const posterior *p, void *arg)
{
    average *a = arg;
    double w = exp(-0.5 * (p->score - a->best)), v = noise(p, a->n);
    if (w < 1e-6) return 0;
    double s = a->n > 4   ? v * (a->n - 2) / (a->n - 4.)
               : a->n > 2 ? 3 * v
                          : v; /* variance of Student's t; of few, what is usual */
    a->sum += w, a->freedom += w * p->freedom, a->variance += w * v;
    for (int j = 0; j < N; j++) {
        a->g[j] += w * p->g[j];
        for (int q = 0; q < N; q++) a->second[j][q] += w * (s * p->inv[j][q] + p->g[j] * p->g[q]);
    }
    return 0;
}

/* Mean and covariance of the curve over all (lambda, law); best gets the likeliest. */
static int average_all(average *a, posterior *best, const fit_data *d)
{
    best->score = INFINITY;
    if (each(d, -1, keep_best, best) || !isfinite(best->score)) return -1;
    memset(a, 0, sizeof *a);
    a->n = count_in(d), a->best = best->score;
    if (each(d, -1, add, a)) return -1;
    a->freedom /= a->sum, a->variance /= a->sum;
    for (int j = 0; j < N; j++) a->g[j] /= a->sum;
    for (int j = 0; j < N; j++)
        for (int q = 0; q < N; q++) a->second[j][q] = a->second[j][q] / a->sum - a->g[j] * a->g[q];
    return 0;
}

/* The fit with g_k >= g_(k+1) from node `from` on. */
static int solve_monotone(double g[N], const fit_data *d, double lambda, int law, int from)
{
    int m = d->n + NPEN;
    double *a = calloc((size_t)m * N, sizeof(double)), *b = calloc((size_t)m, sizeof(double)), row[N], x[N];
    if (!a || !b) {
        free(a);
        free(b);
        return -1;
    }
    for (int i = 0; i < m; i++) {
        double w = i < d->n ? d->in[i] : sqrt(lambda * stiffness(law, i - d->n));
        if (i < d->n) memcpy(row, d->row[i], sizeof row);
        else third(row, i - d->n);
        /* g_k = level - sum of steps before k, in unknowns (level + SHIFT, s_0, s_1, ...); nodes that
         * may rise take part as levels of their own, shifted alike. */
        double *out = a + (size_t)i * N, sum = 0, run = 0;
        for (int k = 0; k < from; k++) out[k] = w * row[k], sum += row[k];
        for (int k = N - 1; k > from; k--) run += row[k], out[k] = -w * run;
        out[from] = w * (run + row[from]);
        sum += run + row[from];
        b[i] = w * ((i < d->n ? d->y[i] : 0) + SHIFT * sum);
    }
    int rc = nnls(x, N, a, b, m);
    double level = x[from] - SHIFT;
    for (int k = 0; k < from; k++) g[k] = x[k] - SHIFT;
    for (int k = from; k < N; k++) {
        if (k > from) level -= x[k];
        g[k] = level;
    }
    free(a);
    free(b);
    return rc;
}

/* Last node up to which the smooth fit proves a rise by three standard deviations. */
static int proven_rise(const average *a)
{
    int top = 0;
    for (int k = 1; k < N; k++)
        if (a->g[k] > a->g[top]) top = k;
    for (int k = 0; k < top; k++) {
        double var = a->second[k][k] + a->second[top][top] - 2 * a->second[k][top];
        if (a->g[top] - a->g[k] > 3 * sqrt(fmax(var, 0)) && a->g[top] - a->g[k] > 1e-3) return top;
    }
    return 0;
}

/* A reading is the mean over its source's angles: that of the curve's cubic, by three points of the same mean
 * and variance. */
static void source_row(double row[N], double t, double spread)
{
    double one[N];
    basis(row, t);
    if (!(spread > 0)) return;
    for (int k = 0; k < N; k++) row[k] *= 2. / 3;
    for (int s = -1; s <= 1; s += 2) {
        basis(one, fabs(t + s * sqrt(3) * spread));
        for (int k = 0; k < N; k++) row[k] += one[k] / 6;
    }
}

/* The logarithm of a mean is more than the mean logarithm, by half the variance of that over the source. */
static void take_off_bend(fit_data *d, const double g[N])
{
    for (int i = 0; i < d->n; i++) {
        double a[N], b[N], h = 0.25;
        basis(a, fabs(d->t[i] - h)), basis(b, fmin(d->t[i] + h, N - 1));
        double slope = (fit_predict(g, b) - fit_predict(g, a)) / (fmin(d->t[i] + h, N - 1) - (d->t[i] - h));
        d->y[i] = d->raw[i] - 0.5 * slope * slope * d->spread[i] * d->spread[i];
    }
}

static int usable(const falloff_reading *r, int c, double half)
{
    return r->y[c] > 0 && isfinite(r->y[c]) && r->theta >= 0 && r->theta <= half * (1 + 1e-9);
}

static int data_make(fit_data *d, const falloff_reading *r, int n, int c, double half)
{
    size_t room = (size_t)(n > 0 ? n : 1);
    memset(d, 0, sizeof *d);
    d->row = malloc(sizeof *d->row * room);
    d->t = malloc(sizeof(double) * 4 * room);
    d->in = malloc(sizeof(int) * room);
    if (!d->row || !d->t || !d->in) return -1;
    d->y = d->t + room, d->raw = d->t + 2 * room, d->spread = d->t + 3 * room;
    for (int i = 0; i < n; i++) {
        if (!usable(r + i, c, half)) continue;
        d->t[d->n] = fmin(r[i].theta / half, 1) * (N - 1);
        d->spread[d->n] = r[i].spread / half * (N - 1);
        d->y[d->n] = d->raw[d->n] = log(r[i].y[c]);
        source_row(d->row[d->n], d->t[d->n], d->spread[d->n]);
        d->in[d->n++] = 1;
    }
    return 0;
}

static void data_free(fit_data *d)
{
    free(d->row);
    free(d->t);
    free(d->in);
}

int falloff_fit(falloff_curve *f, falloff_reading *r, int n, int c, double half, errmsg *e)
{
    fit_data d;
    double g[N];
    int rc = -1;
    average *a = malloc(sizeof *a);
    posterior *best = malloc(sizeof *best);
    for (int i = 0; i < n; i++) r[i].used[c] = 0;
    if (data_make(&d, r, n, c, half) || !a || !best) {
        err_set(e, "out of memory");
        goto done;
    }
    if (d.n < 2) {
        err_set(e, "expected at least 2 usable readings in channel %c, found %d", "RGB"[c], d.n);
        goto done;
    }
    if (fit_outliers(&d) || average_all(a, best, &d)) goto failed;
    take_off_bend(&d, a->g);
    if (average_all(a, best, &d)) goto failed;
    memcpy(g, a->g, sizeof g);
    int from = proven_rise(a), rises = 0;
    for (int k = from; k + 1 < N; k++) rises |= g[k + 1] > g[k];
    if (rises && solve_monotone(g, &d, best->lambda, best->law, from)) goto failed;
    memset(f, 0, sizeof *f);
    f->half = half;
    f->axis = exp(g[0]);
    f->freedom = a->freedom;
    f->scatter = sqrt(a->variance);
    f->rises_to = from * half / (N - 1);
    for (int k = 0; k < N;
         k++) { /* where the free curve rises, the one that may not is off by as much as the other may be */
        double moved = g[k] - g[0] - (a->g[k] - a->g[0]);
        f->v[k] = exp(g[k] - g[0]);
        f->sd[k] = sqrt(fmax(a->second[k][k] + a->second[0][0] - 2 * a->second[k][0], 0) + moved * moved);
    }
    for (int i = 0, j = 0; i < n; i++) {
        if (!usable(r + i, c, half)) continue;
        r[i].used[c] = d.in[j++];
        f->used += r[i].used[c];
    }
    rc = 0;
    goto done;
failed:
    err_set(e, "the falloff of channel %c can't be solved for", "RGB"[c]);
done:
    data_free(&d);
    free(a);
    free(best);
    return rc;
}

double falloff_curve_at(const falloff_curve *f, double theta, double *sd)
{
    double t = fmin(fmax(theta / f->half, 0), 1) * (N - 1), row[N], v = 0;
    basis(row, t);
    for (int k = 0; k < N; k++) v += row[k] * log(f->v[k]);
    int k = t < N - 1 ? (int)t : N - 2;
    if (sd) *sd = f->sd[k] + (t - k) * (f->sd[k + 1] - f->sd[k]);
    return exp(v);
}
