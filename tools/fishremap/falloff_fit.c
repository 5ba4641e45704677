/*
 * falloff_fit.c - penalised, monotone, robust fit of a falloff curve (falloff_fit.h).
 *
 * The monotone problem is least squares with signs: with steps s_k = g_k - g_(k+1) >= 0 and a level
 * that is shifted far above 0 all unknowns are >= 0, which Lawson & Hanson's NNLS (1974)
 * solves exactly; each of its subproblems goes through QR.
 */
#include "falloff_fit.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define N FIT_NODES
#define SHIFT 64.0 /* log units above anything that occurs */

/* Readings of one channel in log units. */
typedef struct data {
    int n;
    double *t, *y, *w; /* t in node units */
} data;

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

/* Symmetric A = sum w b b' + lambda D'D, Cholesky-factored; right-hand side solved in g.  inverse
 * (may be NULL) gets A^-1.  Used for the smooth, unconstrained fit: N is small and the penalty keeps
 * the condition in hand. */
static int solve_smooth(double g[N], double (*inverse)[N], const data *d, double lambda)
{
    static const double ridge = 1e-12;
    double a[N][N], row[N];
    memset(a, 0, sizeof a);
    memset(g, 0, sizeof(double) * N);
    for (int i = 0; i < d->n; i++) {
        if (d->w[i] <= 0) continue;
        basis(row, d->t[i]);
        for (int p = 0; p < N; p++) {
            if (row[p] == 0) continue;
            g[p] += d->w[i] * row[p] * d->y[i];
            for (int q = 0; q < N; q++) a[p][q] += d->w[i] * row[p] * row[q];
        }
    }
    for (int k = 0; k < NPEN; k++) {
        third(row, k);
        for (int p = 0; p < N; p++)
            for (int q = 0; row[p] != 0 && q < N; q++) a[p][q] += lambda * row[p] * row[q];
    }
    for (int p = 0; p < N; p++) a[p][p] += ridge;
    if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', N, &a[0][0], N)) return -1;
    if (LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', N, 1, &a[0][0], N, g, 1)) return -1;
    if (inverse) {
        if (LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'L', N, &a[0][0], N)) return -1;
        for (int p = 0; p < N; p++)
            for (int q = 0; q < N; q++) inverse[p][q] = a[p > q ? p : q][p > q ? q : p];
    }
    return 0;
}

static double predict(const double g[N], double t)
{
    double row[N], v = 0;
    basis(row, t);
    for (int k = 0; k < N; k++) v += row[k] * g[k];
    return v;
}

/* Trace of the smoother: what the fit uses of the readings' freedom. */
static double freedom_of(const data *d, double (*inv)[N])
{
    double s = 0, row[N];
    for (int i = 0; i < d->n; i++) {
        basis(row, d->t[i]);
        for (int p = 0; p < N; p++)
            for (int q = 0; row[p] != 0 && q < N; q++) s += d->w[i] * row[p] * inv[p][q] * row[q];
    }
    return s;
}

static double weight_sum(const data *d)
{
    double s = 0;
    for (int i = 0; i < d->n; i++) s += d->w[i] > 0;
    return s;
}

static double residual(const data *d, const double g[N])
{
    double s = 0;
    for (int i = 0; i < d->n; i++) {
        double r = d->y[i] - predict(g, d->t[i]);
        s += d->w[i] * r * r;
    }
    return s;
}

/* Minimum of GCV over a logarithmic range of lambda; freedom at most n - 1, what n can bear, and what a
 * lens can have: rings of a flat field are many, and their deviations are not independent. */
static double choose_lambda(double *freedom, const data *d)
{
    double best = INFINITY, at = 1e8, n = weight_sum(d), inv[N][N], g[N];
    double most = fmax(fmin(fmin(n - 1, 2 + n / 3), 12), 1.5);
    *freedom = 1;
    for (int k = 0; k <= 56; k++) {
        double lambda = pow(10, 10 - 0.25 * k);
        if (solve_smooth(g, inv, d, lambda)) break;
        double f = freedom_of(d, inv);
        if (f > most) break;
        double score = n * (residual(d, g) + 1e-12) / ((n - f) * (n - f));
        if (score < best) best = score, at = lambda, *freedom = f;
    }
    return at;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median_abs(double *v, int n)
{
    for (int i = 0; i < n; i++) v[i] = fabs(v[i]);
    qsort(v, (size_t)n, sizeof *v, by_value);
    return n % 2 ? v[n / 2] : 0.5 * (v[n / 2 - 1] + v[n / 2]);
}

/* Weights: first absolute deviations, then Tukey's biweight, about a fit of about four parameters. */
static int robust_weights(data *d)
{
    double g[N], inv[N][N], *r = malloc(sizeof(double) * (size_t)d->n), *base = malloc(sizeof(double) * (size_t)d->n);
    int rc = r && base ? 0 : -1, n = d->n;
    for (int i = 0; !rc && i < n; i++) base[i] = d->w[i];
    double lambda = 1e10;
    for (; !rc && lambda > 1e-4; lambda /= 10) { /* as stiff as four parameters allow */
        if (solve_smooth(g, inv, d, lambda)) rc = -1;
        else if (freedom_of(d, inv) > fmin(4, 1 + n / 4.)) break;
    }
    lambda *= 10;
    for (int it = 0; !rc && n >= 5 && it < 60; it++) {
        rc = solve_smooth(g, NULL, d, lambda);
        for (int i = 0; i < n; i++) r[i] = d->y[i] - predict(g, d->t[i]);
        double scale = 1.4826 * median_abs(r, n);
        if (scale < 0.01) scale = 0.01; /* a stiff curve is itself no better */
        for (int i = 0; i < n; i++) {
            double u = fabs(d->y[i] - predict(g, d->t[i])) / (it < 40 ? scale : 6 * scale);
            d->w[i] = base[i] * (it < 40 ? 1 / fmax(u, 0.1) : u < 1 ? (1 - u * u) * (1 - u * u) : 0);
        }
    }
    /* who is in, counts in full */
    for (int i = 0; !rc && n >= 5 && i < n; i++) d->w[i] = d->w[i] > 0.05 * base[i] ? base[i] : 0;
    free(r);
    free(base);
    return rc;
}

/* A stiff curve may have turned away readings that the right one bears out, at the rim above all: take
 * back, and send off again, by the curve that cross-validation chooses, until nothing changes. */
static int settle_weights(double *lambda, double *freedom, data *d)
{
    double g[N], *r = malloc(sizeof(double) * (size_t)d->n);
    if (!r) return -1;
    for (int it = 0, changed = 1; changed && it < 30; it++) {
        int k = 0;
        changed = 0;
        *lambda = choose_lambda(freedom, d);
        if (solve_smooth(g, NULL, d, *lambda)) {
            free(r);
            return -1;
        }
        for (int i = 0; i < d->n; i++)
            if (d->w[i] > 0) r[k++] = d->y[i] - predict(g, d->t[i]);
        double limit = 6 * fmax(1.4826 * median_abs(r, k), 0.003);
        for (int i = 0; i < d->n && d->n >= 5; i++) {
            int in = fabs(d->y[i] - predict(g, d->t[i])) < limit;
            changed |= in != (d->w[i] > 0);
            d->w[i] = in;
        }
        if (weight_sum(d) < 2) changed = 0;
    }
    *lambda = choose_lambda(freedom, d);
    free(r);
    return 0;
}

/* min |A x - b|, x >= 0 (Lawson & Hanson); A row-major m x N. */
static int nnls(double x[N], const double *a, const double *b, int m)
{
    double *r = malloc(sizeof(double) * (size_t)m), *sub = malloc(sizeof(double) * (size_t)m * N), *rhs = malloc(sizeof(double) * (size_t)(m > N ? m : N));
    int in[N] = {0}, rc = r && sub && rhs ? 0 : -1;
    memset(x, 0, sizeof(double) * N);
    for (int outer = 0; !rc && outer < 3 * N; outer++) {
        double best = 0;
        int pick = -1;
        for (int i = 0; i < m; i++) {
            r[i] = b[i];
            for (int k = 0; k < N; k++) r[i] -= a[(size_t)i * N + (size_t)k] * x[k];
        }
        for (int k = 0; k < N; k++) {
            if (in[k]) continue;
            double s = 0, norm = 0;
            for (int i = 0; i < m; i++) s += a[(size_t)i * N + (size_t)k] * r[i], norm += a[(size_t)i * N + (size_t)k] * a[(size_t)i * N + (size_t)k];
            s /= sqrt(norm + 1e-300);
            if (s > best) best = s, pick = k;
        }
        if (pick < 0 || best < 1e-11) break;
        in[pick] = 1;
        for (int inner = 0; inner < 3 * N; inner++) {
            int list[N], np = 0;
            for (int k = 0; k < N; k++)
                if (in[k]) list[np++] = k;
            if (!np) break;
            for (int i = 0; i < m; i++) {
                rhs[i] = b[i];
                for (int k = 0; k < np; k++) sub[(size_t)i * (size_t)np + (size_t)k] = a[(size_t)i * N + (size_t)list[k]];
            }
            if (LAPACKE_dgels(LAPACK_ROW_MAJOR, 'N', m, np, 1, sub, np, rhs, 1)) {
                rc = -1;
                break;
            }
            double step = 1;
            for (int k = 0; k < np; k++)
                if (rhs[k] <= 0) step = fmin(step, x[list[k]] / (x[list[k]] - rhs[k] + 1e-300));
            for (int k = 0; k < np; k++) x[list[k]] += step * (rhs[k] - x[list[k]]);
            if (step >= 1) break;
            for (int k = 0; k < np; k++)
                if (x[list[k]] <= 1e-14) x[list[k]] = 0, in[list[k]] = 0;
        }
    }
    free(r);
    free(sub);
    free(rhs);
    return rc;
}

/* The fit with g_k >= g_(k+1) from node `from` on. */
static int solve_monotone(double g[N], const data *d, double lambda, int from)
{
    int m = d->n + NPEN;
    double *a = calloc((size_t)m * N, sizeof(double)), *b = calloc((size_t)m, sizeof(double)), row[N], x[N];
    if (!a || !b) {
        free(a);
        free(b);
        return -1;
    }
    for (int i = 0; i < m; i++) {
        double w = i < d->n ? sqrt(d->w[i]) : sqrt(lambda);
        if (i < d->n) basis(row, d->t[i]);
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
    int rc = nnls(x, a, b, m);
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
static int proven_rise(const double g[N], double (*inv)[N], double variance)
{
    int top = 0;
    for (int k = 1; k < N; k++)
        if (g[k] > g[top]) top = k;
    for (int k = 0; k < top; k++) {
        double var = variance * (inv[k][k] + inv[top][top] - 2 * inv[k][top]);
        if (g[top] - g[k] > 3 * sqrt(fmax(var, 0)) && g[top] - g[k] > 1e-3) return top;
    }
    return 0;
}

int falloff_fit(falloff_curve *f, falloff_reading *r, int n, int c, double half, errmsg *e)
{
    data d = {0};
    double g[N], inv[N][N], freedom;
    int rc = -1;
    double *room = malloc(sizeof(double) * 3 * (size_t)(n > 0 ? n : 1));
    if (!room) return err_set(e, "out of memory");
    d.t = room, d.y = room + n, d.w = room + 2 * n;
    for (int i = 0; i < n; i++) {
        r[i].used[c] = 0;
        if (!(r[i].y[c] > 0) || !isfinite(r[i].y[c]) || !(r[i].theta >= 0 && r[i].theta <= half * (1 + 1e-9))) continue;
        d.t[d.n] = fmin(r[i].theta / half, 1) * (N - 1);
        d.y[d.n] = log(r[i].y[c]);
        d.w[d.n++] = 1;
    }
    if (d.n < 2) {
        err_set(e, "expected at least 2 usable readings in channel %c, found %d", "RGB"[c], d.n);
        goto done;
    }
    double lambda;
    if (robust_weights(&d) || settle_weights(&lambda, &freedom, &d)) goto failed;
    if (solve_smooth(g, inv, &d, lambda)) goto failed;
    double count = weight_sum(&d), left = count - freedom;
    double variance = left > 0.5 ? residual(&d, g) / left : 0;
    variance = fmax(variance, 1e-8); /* no reading is better than 1e-4 */
    if (count < 4) variance = fmax(variance, 2.5e-5); /* three points can't show their own scatter */
    int from = proven_rise(g, inv, variance);
    int rises = 0;
    for (int k = from; k + 1 < N; k++) rises |= g[k + 1] > g[k];
    if (rises && solve_monotone(g, &d, lambda, from)) goto failed;
    /* A curve that happens to look simple is not trusted far beyond the readings for that: deviations are
     * those of at least four parameters. */
    double stiff = lambda, bend[N];
    for (int k = 0; k < 60 && count >= 6 && freedom_of(&d, inv) < 4; k++)
        if (solve_smooth(bend, inv, &d, stiff /= 2)) goto failed;
    memset(f, 0, sizeof *f);
    f->half = half;
    f->axis = exp(g[0]);
    f->freedom = freedom;
    f->scatter = sqrt(variance);
    f->rises_to = from * half / (N - 1);
    for (int k = 0; k < N; k++) {
        f->v[k] = exp(g[k] - g[0]);
        f->sd[k] = sqrt(fmax(variance * (inv[k][k] + inv[0][0] - 2 * inv[k][0]), 0));
    }
    for (int i = 0, j = 0; i < n; i++) {
        if (!(r[i].y[c] > 0) || !isfinite(r[i].y[c]) || !(r[i].theta >= 0 && r[i].theta <= half * (1 + 1e-9))) continue;
        r[i].used[c] = d.w[j++] > 0;
        f->used += r[i].used[c];
    }
    rc = 0;
    goto done;
failed:
    err_set(e, "the falloff of channel %c can't be solved for", "RGB"[c]);
done:
    free(room);
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
