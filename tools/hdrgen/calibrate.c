/*
 * calibrate.c - Gauss-Newton on response, times and noise together.
 *
 * Model: finv(z_ik) = X_i t_k (1 + rho), variance of rho from noise.h.  For each sample pixel X_i
 * is the inverse-variance mean of finv(z)/t; the pixels are then gathered in bins of ln X, where
 * the mean of rho per exposure says how finv (or ln t) must change:
 *
 *     sum_j B_j(ln f(X t_k)) dc_j - dtau_k - dx_b = -mean(rho)
 *
 * with the place on the curve taken from the prediction as well (residuals.c says why).  Any number of pixels
 * costs bins x exposures rows for the QR.
 */
#include "calibrate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "basis.h"
#include "curve.h"
#include "qrls.h"
#include "residuals.h"

enum { MAX_ROUNDS = 10, MIN_ROUNDS = 4 };

static const double misfit_steps = 1;
static const double least_lambda = 0.01; /* Gauss-Newton needs some hold where data are few */
static const double longest_step = 0.5;  /* of any spline coefficient in one round */

/* What no curve explains is not independent from bin to bin: it is smooth, and where exposures are P
 * stops apart, an error of the curve with that period is all but invisible to the data.  The means' own
 * scatter therefore counts this many times, more where P is large (tried on series of one stop against
 * every second and third of their own exposures). */
static double sharing(const double *lnt, int kk)
{
    double step = 0;
    int steps = 0;
    for (int k = 1; k < kk; k++)
        if (lnt[k] > lnt[k - 1] + 0.1) {
            step += lnt[k] - lnt[k - 1];
            steps++;
        }
    step = steps ? fmax(step / steps / M_LN2, 1) : 1;
    return fmin(pow(step, 10), 3000);
}

/* Rows of one channel; columns: spline changes (if fitted), then time changes (if fitted). */
static int add_rows(qrls *q, const channel *h, const response *r, const double *lnt, const basis *b,
                    int curve_cols, int time_cols, double *rows, double *u)
{
    int m = qrls_columns(q) + 1;
    double shared = sharing(lnt, h->kk);
    for (int i = 0; i < BINS; i++) {
        int used = 0;
        for (int k = 0; k < h->kk; k++) {
            const cellsum *c = &h->cell[i * h->kk + k];
            double w = h->w[i * h->kk + k];
            if (c->n < 1 || !(w > 0)) continue;
            w = 1 / sqrt(1 / (w * c->n) + shared * h->model_error);
            double *row = rows + (size_t)used * (size_t)m, f[4];
            memset(row, 0, sizeof *row * (size_t)m);
            if (curve_cols) {
                double z = response_forward(r, h->c, bin_x(h, i) * exp(lnt[k]));
                int first = basis_eval(b, log(fmax(z, 1)), 0, f);
                for (int j = 0; j < 4; j++) row[first + j] = w * f[j];
            }
            if (time_cols) row[curve_cols + k] = -w;
            row[m - 1] = -w * c->rho / c->n;
            u[used++] = -w;
        }
        if (used > 1 && qrls_add_eliminating(q, rows, u, used)) return -1;
    }
    return 0;
}

typedef struct step {
    double dc[BASIS_N], change; /* of the curve, and its largest part */
    double *dtau, *info;        /* [kk] of ln t, and the weight it deserves */
} step;

/* RMS over the data of the change x of the curve. */
static double curve_change(const channel *h, const response *r, const double *lnt, const basis *b,
                           const double *x)
{
    double sum = 0, weight = 0, f[4];
    for (int i = 0; i < BINS; i++)
        for (int k = 0; k < h->kk; k++) {
            double w = h->w[i * h->kk + k] * h->cell[i * h->kk + k].n, d = 0;
            if (!(w > 0)) continue;
            double z = response_forward(r, h->c, bin_x(h, i) * exp(lnt[k]));
            int first = basis_eval(b, log(fmax(z, 1)), 0, f);
            for (int j = 0; j < 4; j++) d += f[j] * x[first + j];
            sum += w * d * d;
            weight += w;
        }
    return weight > 0 ? sqrt(sum / weight) : 0;
}

static int solve_step(step *d, const channel *h, const response *r, const double *lnt, const double *lnt0,
                      const basis *b, const double *c, const calib_opts *o, calib_facts *facts, errmsg *e)
{
    int cc = o->fit_response ? BASIS_N : 0, tc = o->fit_times ? h->kk : 0, n = cc + tc, code = -1;
    double *x = calloc((size_t)n + 1, sizeof *x), *u = calloc((size_t)h->kk, sizeof *u);
    double *rows = calloc((size_t)h->kk * (size_t)(n + 1), sizeof *rows);
    qrls *q = qrls_new(n);
    qrls_facts qf;
    if (!x || !u || !rows || !q) {
        err_set(e, "out of memory");
        goto done;
    }
    if (add_rows(q, h, r, lnt, b, cc, tc, rows, u) ||
        (cc && (curve_penalty(q, b, fmax(o->lambda, least_lambda), c) || curve_gauge(q, b, 1e4)))) {
        err_set(e, "least squares: LAPACK's QR factorisation failed");
        goto done;
    }
    for (int k = 0; k < tc; k++) { /* prior: ln t is as stated, give or take; the reference exactly */
        double *row = qrls_row(q), w = k == o->reference ? 1e5 : 1 / o->time_spread;
        if (!row) {
            err_set(e, "least squares: LAPACK's QR factorisation failed");
            goto done;
        }
        row[cc + k] = w;
        row[n] = w * (lnt0[k] - lnt[k]);
    }
    if (qrls_solve(q, x, 1e-13, &qf, e)) goto done;
    facts->condition[h->c] = qf.condition;
    d->change = cc ? curve_change(h, r, lnt, b, x) : 0;
    double largest = 0;
    for (int j = 0; j < cc; j++) largest = fmax(largest, fabs(x[j]));
    for (int j = 0; j < cc; j++) d->dc[j] = x[j] * fmin(1, longest_step / fmax(largest, longest_step));
    for (int k = 0; k < tc; k++) {
        d->dtau[k] = fmin(fmax(x[cc + k], -0.7), 0.7);
        d->info[k] = 1e-3;
        for (int i = 0; i < BINS; i++) d->info[k] += h->cell[i * h->kk + k].n * h->w[i * h->kk + k];
    }
    code = 0;
done:
    free(x);
    free(u);
    free(rows);
    qrls_free(q);
    return code;
}

/* One round over all channels; *change gets the largest change of anything. */
static int one_round(response *r, noise_model *noise, double *lnt, const double *lnt0, channel *h,
                     const basis *b, double (*coef)[BASIS_N], const calib_opts *o, calib_facts *facts,
                     double *change, errmsg *e)
{
    int kk = h[0].kk, code = -1, nc = r->channels;
    double *dtau = calloc((size_t)(4 * kk), sizeof *dtau);
    step d = {.dtau = dtau ? dtau + 2 * kk : NULL, .info = dtau ? dtau + 3 * kk : NULL};
    *change = 0;
    if (!dtau) return err_set(e, "out of memory");
    for (int c = 0; c < nc; c++) {
        channel_prepare(&h[c], r, &noise[c], lnt);
        if (facts->rounds == 0) channel_first_x(&h[c], r, &noise[c]);
        channel_gather(&h[c]);
        if (o->fit_noise && channel_fit_noise(&noise[c], &h[c], r, lnt, &o->fixed_noise, facts->rounds > 2)) {
            err_set(e, "out of memory");
            goto done;
        }
        channel_fit_model_error(&h[c]);
        h[c].slack = fmax(1, h[c].slack / 2);
        facts->pixels[c] = channel_pixels(&h[c]);
        facts->chi2[c] = channel_chi2(&h[c]);
        if (!o->fit_response && !o->fit_times) continue;
        if (solve_step(&d, &h[c], r, lnt, lnt0, b, coef[c], o, facts, e)) goto done;
        /* a step that is no larger than what no curve explains would only fit the misfit */
        double small = misfit_steps * sqrt(h[c].model_error);
        *change = fmax(*change, o->fit_response && d.change > small ? d.change : 0);
        for (int j = 0; j < BASIS_N && o->fit_response; j++) coef[c][j] += d.dc[j];
        for (int k = 0; k < kk && o->fit_times; k++) {
            dtau[k] += d.info[k] * d.dtau[k];
            dtau[kk + k] += d.info[k];
        }
    }
    for (int k = 0; k < kk && o->fit_times; k++) {
        double by = dtau[kk + k] > 0 ? dtau[k] / dtau[kk + k] : 0;
        lnt[k] += by;
        *change = fmax(*change, fabs(by));
    }
    for (int c = 0; c < nc && o->fit_response; c++) {
        int bad = curve_to_table(r, c, b, coef[c]);
        if (bad == -2) err_set(e, "out of memory");
        else if (bad)
            err_set(e,
                    "channel %d: the recovered response is not a curve: times or order of the images wrong?",
                    c);
        if (bad) goto done;
    }
    code = 0;
done:
    free(dtau);
    return code;
}

static int copy_response(response *to, const response *from, errmsg *e)
{
    if (response_alloc(to, from->channels, from->max_code, e)) return -1;
    memcpy(to->origin, from->origin, sizeof to->origin);
    memcpy(to->clip, from->clip, sizeof to->clip);
    for (int c = 0; c < from->channels; c++)
        memcpy(to->finv[c], from->finv[c], sizeof *to->finv[c] * (size_t)(from->max_code + 1));
    return 0;
}

/* Normalise the response; the noise model's unit, the exposure at the highest code, goes with it. */
static int rescale(response *r, noise_model *m)
{
    double before[RESPONSE_MAX_CHANNELS];
    for (int c = 0; c < r->channels; c++) before[c] = r->finv[c][r->max_code];
    if (response_normalise(r)) return -1;
    for (int c = 0; c < r->channels; c++) {
        double by = r->finv[c][r->max_code] / before[c];
        m[c].photon *= by;
        m[c].read *= by;
    }
    return 0;
}

int calibrate(response *r, noise_model *noise, double *lnt, calib_facts *facts, const samples *s,
              const calib_opts *o, errmsg *e)
{
    channel h[RESPONSE_MAX_CHANNELS] = {{0}};
    double coef[RESPONSE_MAX_CHANNELS][BASIS_N], change = 0;
    noise_model m[RESPONSE_MAX_CHANNELS];
    response work = {0};
    basis b;
    int kk = s->exposures, code = -1;
    double *t = malloc(sizeof *t * (size_t)kk);
    memset(facts, 0, sizeof *facts);
    if (!t || copy_response(&work, r, e)) {
        free(t);
        return t ? -1 : err_set(e, "out of memory");
    }
    memcpy(t, lnt, sizeof *t * (size_t)kk);
    basis_init(&b, response_top(&work));
    for (int c = 0; c < r->channels; c++) {
        m[c] = noise[c];
        if (channel_alloc(&h[c], s, c)) {
            err_set(e, "out of memory");
            goto done;
        }
        if (o->fit_response && curve_from_table(coef[c], r, c, &b, e)) goto done;
    }
    for (; facts->rounds < MAX_ROUNDS; facts->rounds++) {
        if (one_round(&work, m, t, lnt, h, &b, coef, o, facts, &change, e)) goto done;
        if (facts->rounds + 1 >= MIN_ROUNDS && change < 5e-4) break;
    }
    if (o->fit_response && rescale(&work, m)) {
        err_set(e, "the recovered responses of the channels have nothing in common: times or order of the "
                   "images wrong?");
        goto done;
    }
    memcpy(lnt, t, sizeof *t * (size_t)kk);
    memcpy(noise, m, sizeof *m * (size_t)r->channels);
    response_free(r);
    *r = work;
    memset(&work, 0, sizeof work);
    code = 0;
done:
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) channel_free(&h[c]);
    response_free(&work);
    free(t);
    return code;
}
