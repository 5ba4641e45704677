/*
 * mitsunaga.c - Mitsunaga & Nayar, Radiometric Self Calibration (1999), eq. 7: polynomials.
 *
 * e = sum_n c_n x^n, x = z / max, with sum c_n = 1 (e = 1 at x = 1) and c_0 = 0 (no light, no code).  For
 * exposures p, q of one pixel:  sum_n c_n (x_p^n - R x_q^n) = 0, R = t_p / t_q.  The constraint is
 * put in by c_1 = 1 - sum others.
 */
#include <math.h>
#include <string.h>

#include "debevec.h"
#include "qrls.h"

enum { MAX_ORDER = 8, MIN_ROWS = 32 };

static double poly(const double *c, int order, double x)
{
    double sum = 0;
    for (int k = order; k >= 1; k--) sum = (sum + c[k]) * x;
    return sum;
}

/* Rows for all neighbouring pairs (by time) of usable samples; returns their number. */
static long pair_rows(qrls *q, const samples *s, int c, const double *lnt, const int *by_time, int order)
{
    long rows = 0;
    double top = s->clip[c];
    for (int i = 0; i < s->n[c]; i++) {
        const uint16_t *z = s->z[c] + (size_t)i * (size_t)s->exposures;
        for (int k = 1; k < s->exposures && !s->out[c][i]; k++) {
            int p = by_time[k - 1], t = by_time[k];
            if (z[p] == 0 || z[t] >= s->max_code || z[p] >= s->max_code || !(lnt[t] > lnt[p])) continue;
            double xp = z[p] / top, xt = z[t] / top, ratio = exp(lnt[p] - lnt[t]);
            /* weight: the shorter exposure's code is the noisier one */
            double w = 2 * fmin(xp, 1 - xt) + 0.02, *row = qrls_row(q);
            if (!row) return -1;
            double lp = xp - ratio * xt, pp = xp, pt = xt;
            for (int n = 2; n <= order; n++) {
                pp *= xp;
                pt *= xt;
                row[n - 2] = w * (pp - ratio * pt - lp);
            }
            row[order - 1] = -w * lp;
            rows++;
        }
    }
    return rows;
}

static int fit_order(double *c, double *rms, double *condition, const samples *s, int ch, const double *lnt,
                     const int *by_time, int order, errmsg *e)
{
    double x[MAX_ORDER] = {0};
    qrls_facts f = {0};
    if (order == 1) {
        c[1] = 1;
    }
    qrls *q = qrls_new(order > 1 ? order - 1 : 1);
    if (!q) return err_set(e, "out of memory");
    long rows = order > 1 ? pair_rows(q, s, ch, lnt, by_time, order) : 0;
    int bad = 0;
    if (rows < 0) bad = err_set(e, "least squares: LAPACK's QR factorisation failed");
    else if (order > 1 && rows < MIN_ROWS)
        bad =
            err_set(e, "channel %d: expected at least %d pairs of usable samples, found %ld: give --response",
                    ch, MIN_ROWS, rows);
    else if (order > 1) bad = qrls_solve(q, x, 1e-13, &f, e);
    qrls_free(q);
    if (bad) return -1;
    if (order > 1) {
        c[1] = 1;
        for (int n = 2; n <= order; n++) {
            c[n] = x[n - 2];
            c[1] -= c[n];
        }
        *rms = sqrt(f.rss / (double)rows);
        *condition = f.condition;
    }
    return 0;
}

static int rises(const double *c, int order)
{
    double last = 0;
    for (int i = 1; i <= 512; i++) {
        double y = poly(c, order, i / 512.0);
        if (!(y > last)) return 0;
        last = y;
    }
    return 1;
}

/* Codes above white, that don't occur, in a straight line. */
static double beyond(const double *c, int order, double x)
{
    return x <= 1 ? poly(c, order, x) : 1 + (x - 1) * fmax(0, (1 - poly(c, order, 0.99)) / 0.01);
}

static int one_channel(response *r, int ch, solve_facts *facts, const samples *s, const double *lnt,
                       const int *by_time, errmsg *e)
{
    double best[MAX_ORDER + 1] = {0}, least = INFINITY;
    int order = 0;
    for (int n = 2; n <= MAX_ORDER; n++) {
        double c[MAX_ORDER + 1] = {0}, rms = 0, condition = 0;
        if (fit_order(c, &rms, &condition, s, ch, lnt, by_time, n, e)) return -1;
        if (rises(c, n) && rms < least * 0.995) {
            least = rms;
            order = n;
            memcpy(best, c, sizeof best);
            facts->condition[ch] = condition;
            facts->residual[ch] = rms;
        }
    }
    if (!order)
        return err_set(e, "channel %d: no rising polynomial fits: times or order of the images wrong?", ch);
    facts->pixels[ch] = s->n[ch];
    for (int z = 1; z <= r->max_code; z++) r->finv[ch][z] = beyond(best, order, (double)z / s->clip[ch]);
    int changed = response_make_monotone(r, ch);
    if (changed == -2) return err_set(e, "out of memory");
    return changed < 0 ? err_set(e, "channel %d: the polynomial is not positive", ch) : 0;
}

int mitsunaga_solve(response *r, solve_facts *facts, const samples *s, const double *lnt, errmsg *e)
{
    response got;
    int by_time[1024];
    memset(facts, 0, sizeof *facts);
    if (s->exposures > 1024) return err_set(e, "expected at most 1024 images, found %d", s->exposures);
    for (int k = 0; k < s->exposures; k++) {
        int at = 0;
        for (int i = 0; i < s->exposures; i++) at += lnt[i] < lnt[k] || (lnt[i] == lnt[k] && i < k);
        by_time[at] = k;
    }
    if (response_alloc(&got, s->channels, s->max_code, e)) return -1;
    memcpy(got.clip, s->clip, sizeof got.clip);
    for (int c = 0; c < s->channels; c++)
        if (one_channel(&got, c, facts, s, lnt, by_time, e)) {
            response_free(&got);
            return -1;
        }
    return response_recovered(r, &got, "mitsunaga", e);
}
