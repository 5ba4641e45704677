/*
 * residuals.c - see residuals.h.
 *
 * Everything that weights or selects a sample (variance, active or not) is taken from the predicted
 * exposure X t_k, never from the noisy sample itself: the residuals of a weighted mean are uncorrelated with
 * it, so what is learnt from them has no bias where Debevec & Malik's logarithms and Robertson's sample
 * weights have.
 */
#include "residuals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CELLS = 96, MIN_IN_NOISE = 30 };

static const double dark_sigmas = 1.5;   /* active from e = 1.5 sigma */
static const double bright_sigmas = 3.5; /* ... to 3.5 sigma under the clipped code */
static const double outlier_sigmas = 4;

double bin_x(const channel *h, int b)
{
    return exp(h->lx0 + (b + 0.5) / h->bins_per_ln);
}

static int bin_of(const channel *h, double x)
{
    double b = (log(x) - h->lx0) * h->bins_per_ln;
    return b < 0 ? 0 : b >= BINS ? BINS - 1 : (int)b;
}

void channel_free(channel *h)
{
    free(h->x);
    free(h->w);
    free(h->limit);
    free(h->shift);
    free(h->rt);
    free(h->y);
    free(h->cell);
    free(h->code_w);
    free(h->scatter);
}

int channel_alloc(channel *h, const samples *s, int c)
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
    h->limit = calloc(cells, sizeof *h->limit);
    h->shift = calloc(cells, sizeof *h->shift);
    h->rt = calloc((size_t)h->kk, sizeof *h->rt);
    h->y = calloc((size_t)s->max_code + 1, sizeof *h->y);
    h->cell = calloc(cells, sizeof *h->cell);
    h->code_w = calloc((size_t)s->max_code + 1, sizeof *h->code_w);
    h->scatter = calloc(2 * cells, sizeof *h->scatter);
    return h->x && h->w && h->limit && h->shift && h->rt && h->y && h->cell && h->code_w && h->scatter ? 0
                                                                                                       : -1;
}

void channel_prepare(channel *h, const response *r, const noise_model *m, const double *lnt)
{
    double tmin = INFINITY, tmax = -INFINITY;
    const double *f = r->finv[h->c];
    int top = r->clip[h->c];
    for (int k = 0; k < h->kk; k++) {
        tmin = fmin(tmin, lnt[k]);
        tmax = fmax(tmax, lnt[k]);
        h->rt[k] = (float)exp(-lnt[k]);
    }
    for (int z = 0; z <= r->max_code; z++) h->y[z] = (float)f[z];
    double lo = log(f[1]) - tmax, hi = log(f[top]) - tmin;
    h->lx0 = lo;
    h->bins_per_ln = BINS / (hi - lo);
    double clip = response_edge(r, h->c, top);
    for (int b = 0; b < BINS; b++) {
        h->first[b] = h->kk;
        h->last[b] = 0;
        for (int k = 0; k < h->kk; k++) {
            double e = bin_x(h, b) * exp(lnt[k]), w = 0;
            if (e < clip && e > f[1]) {
                double z = response_forward(r, h->c, e);
                double v = noise_variance(m, e, response_slope(r, h->c, (int)(z + 0.5)));
                double sd = sqrt(v);
                if (e > dark_sigmas * sd && e + bright_sigmas * sd < clip) w = e * e / v;
            }
            h->w[b * h->kk + k] = (float)w;
            if (!(w > 0)) continue;
            double a = sqrt(w); /* e in sigmas; E[max(n, 0)] for a normal n, less e, over e */
            h->shift[b * h->kk + k] =
                (float)(exp(-0.5 * a * a) / (sqrt(2 * M_PI) * a) - 0.5 * erfc(a * M_SQRT1_2));
            h->limit[b * h->kk + k] = (float)(outlier_sigmas * sqrt(h->slack / w));
            h->first[b] = k < h->first[b] ? k : h->first[b];
            h->last[b] = k + 1;
        }
    }
}

static float pedestal(const channel *h, int i)
{
    return h->s->dark[h->c] ? h->y[h->s->dark[h->c][i]] : 0;
}

void channel_first_x(channel *h, const response *r, const noise_model *m)
{
    int top = r->clip[h->c];
    float *w = h->code_w;
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
        h->x[i] = den > 0 && num > 0 && !h->s->out[h->c][i] ? num / den : 0;
    }
}

void channel_gather(channel *h)
{
    int kk = h->kk, top = h->s->max_code;
    memset(h->cell, 0, sizeof *h->cell * (size_t)(BINS * kk));
    for (int i = 0; i < h->n; i++) {
        if (!(h->x[i] > 0)) continue;
        const uint16_t *z = h->s->z[h->c] + (size_t)i * (size_t)kk;
        int b = bin_of(h, h->x[i]);
        const float *w = h->w + b * kk, *shift = h->shift + b * kk;
        float num = 0, den = 0, dark = pedestal(h, i);
        for (int k = h->first[b]; k < h->last[b]; k++) {
            float wk = z[k] < top ? w[k] : 0;
            num += wk * ((h->y[z[k]] - dark) * h->rt[k] - shift[k] * h->x[i]);
            den += wk;
        }
        if (!(den > 0) || !(num > 0)) continue;
        h->x[i] = num / den;
        b = bin_of(h, h->x[i]);
        w = h->w + b * kk;
        shift = h->shift + b * kk;
        const float *limit = h->limit + b * kk;
        float rx = 1 / h->x[i], rden = 1 / den;
        cellsum *cell = h->cell + b * kk;
        for (int k = h->first[b]; k < h->last[b]; k++) {
            if (!(w[k] > 0) || z[k] >= top) continue;
            float rho = (h->y[z[k]] - dark) * h->rt[k] * rx - 1 - shift[k];
            rho = rho < -limit[k] ? -limit[k] : rho > limit[k] ? limit[k] : rho;
            cell[k].n++;
            cell[k].rho += rho;
            float leverage = w[k] * rden;
            if (leverage < 0.9f) {
                cell[k].sq += rho * rho / (1 - leverage);
                cell[k].sq_n++;
            }
        }
    }
}

/* Put the residuals' scatter in cells of a third of an octave in e, and fit. */
int channel_fit_noise(noise_model *m, const channel *h, const response *r, const double *lnt,
                      const noise_model *fixed, int damped)
{
    noise_cell sum[CELLS] = {{0}}, full[CELLS];
    int used = 0;
    for (int b = 0; b < BINS; b++)
        for (int k = 0; k < h->kk; k++) {
            const cellsum *c = &h->cell[b * h->kk + k];
            if (c->sq_n < 2) continue;
            /* about the bin's own mean: an error of the response is not noise */
            double mean = c->rho / c->n, square = (c->sq - c->sq_n * mean * mean) * c->sq_n / (c->sq_n - 1);
            double e = bin_x(h, b) * exp(lnt[k]);
            int at = (int)(CELLS - 1 + floor(3 * log2(e)));
            if (at < 0 || at >= CELLS) continue;
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
    int none = noise_fit(m, full, used, fixed);
    if (!none && damped) { /* it also decides which samples are active */
        m->photon = 0.5 * (m->photon + was.photon);
        m->read = 0.5 * (m->read + was.read);
        m->code_var = 0.5 * (m->code_var + was.code_var);
    }
    return none == -2 ? -1 : 0;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Means over many pixels know the curve to 1e-4, real cameras (flare, drift, registration) don't keep to
 * any curve that well: the part of the means' scatter that noise can't explain, from medians. */
void channel_fit_model_error(channel *h)
{
    enum { FEW = 5, LEAST = 20 };
    int n = 0, all = BINS * h->kk;
    double *rho = h->scatter, *var = h->scatter + all;
    for (int i = 0; i < all; i++)
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
}

double channel_chi2(const channel *h)
{
    double sum = 0, n = 0;
    for (int i = 0; i < BINS * h->kk; i++)
        if (h->cell[i].sq_n > 0 && h->w[i] > 0) {
            sum += h->cell[i].sq * h->w[i];
            n += h->cell[i].sq_n;
        }
    return n > 0 ? sum / n : 0;
}

int channel_pixels(const channel *h)
{
    int pixels = 0;
    for (int i = 0; i < h->n; i++) pixels += h->x[i] > 0;
    return pixels;
}
