/*
 * calibrate.c - Gauss-Newton on response, times and noise together.
 *
 * Model: finv(z_ik) = X_i t_k (1 + rho), variance of rho from noise.h.  For each sample pixel X_i
 * is the inverse-variance mean of finv(z)/t; the pixels are then gathered in bins of ln X, where
 * the mean of rho per exposure says how finv (or ln t) must change:
 *
 *     sum_j B_j(ln f(X t_k)) dc_j - dtau_k - dx_b = -mean(rho)
 *
 * Everything that weights or selects a sample (variance, active or not, the place on the curve) is taken
 * from the predicted exposure X t_k, never from the noisy sample itself: the residuals of a weighted
 * mean are uncorrelated with it, so the equations have no bias where Debevec & Malik's log and
 * Robertson's sample weights have.  Any number of pixels costs bins x exposures rows for the QR.
 */
#include "calibrate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "basis.h"
#include "curve.h"
#include "qrls.h"

enum { BINS = 512, MAX_ROUNDS = 10, MIN_ROUNDS = 4, CELLS = 96, MIN_IN_NOISE = 30 };

static const double dark_sigmas = 3;   /* active from e = 3 sigma: no black clipping */
static const double bright_sigmas = 3.5; /* ... to 3.5 sigma under the clipped code */
static const double outlier_sigmas = 4;
static const double misfit_steps = 1;
static const double least_lambda = 0.01; /* Gauss-Newton needs some hold where data are few */
static const double longest_step = 0.5;  /* of any spline coefficient in one round */

typedef struct cellsum {
    double n, rho, sq, sq_n;
} cellsum;

typedef struct channel {
    const samples *s;
    int c, n, kk;
    double lx0, bins_per_ln;  /* bin = (ln X - lx0) * bins_per_ln */
    float *x;                 /* [n] current X, 0: no usable sample */
    float *w;                 /* [BINS * kk] 1 / relative variance, 0 inactive */
    float *rt;                /* 1 / t_k */
    float *y;                 /* finv as float */
    cellsum *cell;            /* [BINS * kk] */
    double model_error;       /* mean square of what noise does not explain in the bins' means */
    double slack;             /* variances are multiplied by this while far from the solution */
} channel;

static double bin_x(const channel *h, int b)
{
    return exp(h->lx0 + (b + 0.5) / h->bins_per_ln);
}

static int bin_of(const channel *h, double x)
{
    double b = (log(x) - h->lx0) * h->bins_per_ln;
    return b < 0 ? 0 : b >= BINS ? BINS - 1 : (int)b;
}

static void channel_free(channel *h)
{
    free(h->x);
    free(h->w);
    free(h->rt);
    free(h->y);
    free(h->cell);
}

static int channel_alloc(channel *h, const samples *s, int c)
{
    memset(h, 0, sizeof *h);
    h->s = s;
    h->c = c;
    h->n = s->n[c];
    h->kk = s->exposures;
    h->slack = 4;
    size_t cells = (size_t)BINS * (size_t)h->kk;
    h->x = calloc((size_t)h->n + 1, sizeof *h->x);
    h->w = calloc(cells, sizeof *h->w);
    h->rt = calloc((size_t)h->kk, sizeof *h->rt);
    h->y = calloc((size_t)s->max_code + 1, sizeof *h->y);
    h->cell = calloc(cells, sizeof *h->cell);
    return h->x && h->w && h->rt && h->y && h->cell ? 0 : -1;
}

/* Tables for the current response, noise and times. */
static void prepare(channel *h, const response *r, const noise_model *m, const double *lnt)
{
    double tmin = INFINITY, tmax = -INFINITY;
    const double *f = r->finv[h->c];
    int top = r->max_code;
    for (int k = 0; k < h->kk; k++) {
        tmin = fmin(tmin, lnt[k]);
        tmax = fmax(tmax, lnt[k]);
        h->rt[k] = (float)exp(-lnt[k]);
    }
    for (int z = 0; z <= top; z++)
        h->y[z] = (float)f[z];
    double lo = log(f[1]) - tmax, hi = log(f[top]) - tmin;
    h->lx0 = lo;
    h->bins_per_ln = BINS / (hi - lo);
    double clip = response_edge(r, h->c, top);
    for (int b = 0; b < BINS; b++)
        for (int k = 0; k < h->kk; k++) {
            double e = bin_x(h, b) * exp(lnt[k]), w = 0;
            if (e < clip && e > f[1]) {
                double z = response_forward(r, h->c, e);
                double v = noise_variance(m, e, response_slope(r, h->c, (int)(z + 0.5)));
                double sd = sqrt(v);
                if (e > dark_sigmas * sd && e + bright_sigmas * sd < clip)
                    w = e * e / v;
            }
            h->w[b * h->kk + k] = (float)w;
        }
}

static float pedestal(const channel *h, int i)
{
    return h->s->dark[h->c] ? h->y[h->s->dark[h->c][i]] : 0;
}

/* First X: weights from the samples themselves. */
static void first_x(channel *h, const response *r, const noise_model *m)
{
    int top = r->max_code;
    float *w = calloc((size_t)top + 1, sizeof *w);
    if (!w)
        return;
    for (int z = 1; z < top; z++) {
        double e = r->finv[h->c][z];
        w[z] = (float)(e * e / noise_variance(m, e, response_slope(r, h->c, z)));
    }
    for (int i = 0; i < h->n; i++) {
        const uint16_t *z = h->s->z[h->c] + (size_t)i * (size_t)h->kk;
        float num = 0, den = 0, dark = pedestal(h, i);
        for (int k = 0; k < h->kk; k++) {
            num += w[z[k]] * (h->y[z[k]] - dark) * h->rt[k];
            den += w[z[k]];
        }
        h->x[i] = den > 0 && num > 0 ? num / den : 0;
    }
    free(w);
}

/* X of every pixel, and the residuals by bin and exposure. */
static void gather(channel *h)
{
    int kk = h->kk, top = h->s->max_code;
    memset(h->cell, 0, sizeof *h->cell * (size_t)(BINS * kk));
    for (int i = 0; i < h->n; i++) {
        if (!(h->x[i] > 0))
            continue;
        const uint16_t *z = h->s->z[h->c] + (size_t)i * (size_t)kk;
        const float *w = h->w + bin_of(h, h->x[i]) * kk;
        float num = 0, den = 0, dark = pedestal(h, i);
        for (int k = 0; k < kk; k++) {
            float wk = z[k] < top ? w[k] : 0;
            num += wk * (h->y[z[k]] - dark) * h->rt[k];
            den += wk;
        }
        if (!(den > 0) || !(num > 0))
            continue;
        h->x[i] = num / den;
        int b = bin_of(h, h->x[i]);
        w = h->w + b * kk;
        cellsum *cell = h->cell + b * kk;
        for (int k = 0; k < kk; k++) {
            if (!(w[k] > 0) || z[k] >= top)
                continue;
            double rho = (h->y[z[k]] - dark) * h->rt[k] / h->x[i] - 1;
            double limit = outlier_sigmas * sqrt(h->slack / w[k]);
            rho = fmin(fmax(rho, -limit), limit);
            cell[k].n++;
            cell[k].rho += rho;
            double leverage = w[k] / den;
            if (leverage < 0.9) {
                cell[k].sq += rho * rho / (1 - leverage);
                cell[k].sq_n++;
            }
        }
    }
}

/* Put the residuals' scatter in cells of a third of an octave in e, and fit. */
static void fit_noise(noise_model *m, const channel *h, const response *r, const double *lnt,
                      const noise_model *fixed, int damped)
{
    noise_cell sum[CELLS] = {{0}}, full[CELLS];
    int used = 0;
    for (int b = 0; b < BINS; b++)
        for (int k = 0; k < h->kk; k++) {
            const cellsum *c = &h->cell[b * h->kk + k];
            if (c->sq_n < 2)
                continue;
            /* about the bin's own mean: an error of the response is not noise */
            double mean = c->rho / c->n, square = (c->sq - c->sq_n * mean * mean) * c->sq_n / (c->sq_n - 1);
            double e = bin_x(h, b) * exp(lnt[k]);
            int at = (int)(CELLS - 1 + floor(3 * log2(e)));
            if (at < 0 || at >= CELLS)
                continue;
            double z = response_forward(r, h->c, e);
            sum[at].n += c->sq_n;
            sum[at].e += c->sq_n * e;
            sum[at].slope += c->sq_n * response_slope(r, h->c, (int)(z + 0.5));
            sum[at].relative_square += fmax(square, 0);
        }
    for (int i = 0; i < CELLS; i++)
        if (sum[i].n >= MIN_IN_NOISE) {
            full[used] = sum[i];
            full[used].e /= sum[i].n;
            full[used].slope /= sum[i].n;
            full[used++].relative_square /= sum[i].n;
        }
    noise_model was = *m;
    if (noise_fit(m, full, used, fixed) == 0 && damped) { /* it also decides which samples are active */
        m->photon = 0.5 * (m->photon + was.photon);
        m->read = 0.5 * (m->read + was.read);
        m->code_var = 0.5 * (m->code_var + was.code_var);
    }
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Means over many pixels know the curve to 1e-4, real cameras (flare, drift, registration) don't keep to
 * any curve that well: the part of the means' scatter that noise can't explain, from medians. */
static void fit_model_error(channel *h)
{
    enum { FEW = 5, LEAST = 20 };
    int n = 0, all = BINS * h->kk;
    double *rho = malloc(sizeof *rho * (size_t)all), *var = malloc(sizeof *var * (size_t)all);
    for (int i = 0; i < all && rho && var; i++)
        if (h->cell[i].n >= FEW && h->w[i] > 0) {
            double mean = h->cell[i].rho / h->cell[i].n;
            rho[n] = mean * mean;
            var[n++] = 1 / (h->w[i] * h->cell[i].n);
        }
    h->model_error = 0;
    if (n >= LEAST) {
        qsort(rho, (size_t)n, sizeof *rho, by_value);
        qsort(var, (size_t)n, sizeof *var, by_value);
        h->model_error = fmax(rho[n / 2] / 0.455 - var[n / 2], 0); /* chi-square(1) has median 0.455 */
    }
    free(rho);
    free(var);
}

/* Rows of one channel; columns: spline changes (if fitted), then time changes (if fitted). */
static int add_rows(qrls *q, const channel *h, const response *r, const double *lnt,
                    const basis *b, int curve_cols, int time_cols, double *rows, double *u)
{
    int m = qrls_columns(q) + 1;
    for (int i = 0; i < BINS; i++) {
        int used = 0;
        for (int k = 0; k < h->kk; k++) {
            const cellsum *c = &h->cell[i * h->kk + k];
            double w = h->w[i * h->kk + k];
            if (c->n < 1 || !(w > 0))
                continue;
            w = 1 / sqrt(1 / (w * c->n) + h->model_error);
            double *row = rows + (size_t)used * (size_t)m, f[4];
            memset(row, 0, sizeof *row * (size_t)m);
            if (curve_cols) {
                double z = response_forward(r, h->c, bin_x(h, i) * exp(lnt[k]));
                int first = basis_eval(b, log(fmax(z, 1)), 0, f);
                for (int j = 0; j < 4; j++)
                    row[first + j] = w * f[j];
            }
            if (time_cols)
                row[curve_cols + k] = -w;
            row[m - 1] = -w * c->rho / c->n;
            u[used++] = -w;
        }
        if (used > 1 && qrls_add_eliminating(q, rows, u, used))
            return -1;
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
            if (!(w > 0))
                continue;
            double z = response_forward(r, h->c, bin_x(h, i) * exp(lnt[k]));
            int first = basis_eval(b, log(fmax(z, 1)), 0, f);
            for (int j = 0; j < 4; j++)
                d += f[j] * x[first + j];
            sum += w * d * d;
            weight += w;
        }
    return weight > 0 ? sqrt(sum / weight) : 0;
}

static int solve_step(step *d, const channel *h, const response *r, const double *lnt,
                      const double *lnt0, const basis *b, const double *c, const calib_opts *o,
                      calib_facts *facts, errmsg *e)
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
    if (qrls_solve(q, x, 1e-13, &qf, e))
        goto done;
    facts->condition[h->c] = qf.condition;
    d->change = cc ? curve_change(h, r, lnt, b, x) : 0;
    double largest = 0;
    for (int j = 0; j < cc; j++)
        largest = fmax(largest, fabs(x[j]));
    for (int j = 0; j < cc; j++)
        d->dc[j] = x[j] * fmin(1, longest_step / fmax(largest, longest_step));
    for (int k = 0; k < tc; k++) {
        d->dtau[k] = fmin(fmax(x[cc + k], -0.7), 0.7);
        d->info[k] = 1e-3;
        for (int i = 0; i < BINS; i++)
            d->info[k] += h->cell[i * h->kk + k].n * h->w[i * h->kk + k];
    }
    code = 0;
done:
    free(x);
    free(u);
    free(rows);
    qrls_free(q);
    return code;
}

static void count(calib_facts *facts, const channel *h)
{
    double sum = 0, n = 0;
    int pixels = 0;
    for (int i = 0; i < BINS * h->kk; i++)
        if (h->cell[i].sq_n > 0 && h->w[i] > 0) {
            sum += h->cell[i].sq * h->w[i];
            n += h->cell[i].sq_n;
        }
    for (int i = 0; i < h->n; i++)
        pixels += h->x[i] > 0;
    facts->pixels[h->c] = pixels;
    facts->chi2[h->c] = n > 0 ? sum / n : 0;
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
    if (!dtau)
        return err_set(e, "out of memory");
    for (int c = 0; c < nc; c++) {
        prepare(&h[c], r, &noise[c], lnt);
        if (facts->rounds == 0)
            first_x(&h[c], r, &noise[c]);
        gather(&h[c]);
        if (o->fit_noise)
            fit_noise(&noise[c], &h[c], r, lnt, &o->fixed_noise, facts->rounds > 2);
        fit_model_error(&h[c]);
        h[c].slack = fmax(1, h[c].slack / 2);
        count(facts, &h[c]);
        if (!o->fit_response && !o->fit_times)
            continue;
        if (solve_step(&d, &h[c], r, lnt, lnt0, b, coef[c], o, facts, e))
            goto done;
        /* a step that is no larger than what no curve explains would only fit the misfit */
        double small = misfit_steps * sqrt(h[c].model_error);
        *change = fmax(*change, o->fit_response && d.change > small ? d.change : 0);
        for (int j = 0; j < BASIS_N && o->fit_response; j++)
            coef[c][j] += d.dc[j];
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
    for (int c = 0; c < nc && o->fit_response; c++)
        if (curve_to_table(r, c, b, coef[c])) {
            err_set(e, "channel %d: the recovered response is not a curve: times or order of the images wrong?", c);
            goto done;
        }
    code = 0;
done:
    free(dtau);
    return code;
}

static int copy_response(response *to, const response *from, errmsg *e)
{
    if (response_alloc(to, from->channels, from->max_code, e))
        return -1;
    memcpy(to->origin, from->origin, sizeof to->origin);
    for (int c = 0; c < from->channels; c++)
        memcpy(to->finv[c], from->finv[c], sizeof *to->finv[c] * (size_t)(from->max_code + 1));
    return 0;
}

/* Normalise the response; the noise model's unit, the exposure at the highest code, goes with it. */
static void rescale(response *r, noise_model *m)
{
    double before[RESPONSE_MAX_CHANNELS];
    for (int c = 0; c < r->channels; c++)
        before[c] = r->finv[c][r->max_code];
    response_normalise(r);
    for (int c = 0; c < r->channels; c++) {
        double by = r->finv[c][r->max_code] / before[c];
        m[c].photon *= by;
        m[c].read *= by;
    }
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
    basis_init(&b, s->max_code);
    if (!t || copy_response(&work, r, e)) {
        free(t);
        return t ? -1 : err_set(e, "out of memory");
    }
    memcpy(t, lnt, sizeof *t * (size_t)kk);
    for (int c = 0; c < r->channels; c++) {
        m[c] = noise[c];
        if (channel_alloc(&h[c], s, c)) {
            err_set(e, "out of memory");
            goto done;
        }
        if (o->fit_response && curve_from_table(coef[c], r, c, &b, e))
            goto done;
    }
    for (; facts->rounds < MAX_ROUNDS; facts->rounds++) {
        if (one_round(&work, m, t, lnt, h, &b, coef, o, facts, &change, e))
            goto done;
        if (facts->rounds + 1 >= MIN_ROUNDS && change < 3e-4)
            break;
    }
    if (o->fit_response)
        rescale(&work, m);
    memcpy(lnt, t, sizeof *t * (size_t)kk);
    memcpy(noise, m, sizeof *m * (size_t)r->channels);
    response_free(r);
    *r = work;
    memset(&work, 0, sizeof work);
    code = 0;
done:
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++)
        channel_free(&h[c]);
    response_free(&work);
    free(t);
    return code;
}
