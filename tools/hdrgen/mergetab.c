/*
 * mergetab.c - the merge's tables: what samples are expected to say, from response and noise.
 *
 * A sample of true exposure e is recorded as a code after Gaussian noise (noise.h), rounding and the two
 * ends of the scale; y = finv(code).  The tables hold mean and variance of y given e and given that it is
 * not clipped at the top, so that the quasi-likelihood step in merge.c is free of the bias of black
 * clipping, rounding and of the choice of unclipped samples.
 */
#include <math.h>
#include <stdlib.h>

#include "merge_internal.h"

static const double safe_share = 0.7;    /* of the exposure that clips */
static const double most_clipped = 0.05; /* no say for samples more likely clipped than this */
static const double surely_no_noise = 5; /* standard deviations */

static double normal_cdf(double x)
{
    return 0.5 * erfc(-x * M_SQRT1_2);
}

static void code_values(merge_channel *ch, const response *r, int c, const noise_model *m,
                        merge_weight weight)
{
    int top = r->clip[c];
    for (int z = 0; z <= r->max_code; z++) {
        codeval *v = &ch->code[z];
        double e = r->finv[c][z];
        int inside = z > 0 && z < top;
        v->y = z < top ? (float)e : 0;
        v->valid = z < top;
        double w = 0;
        if (inside && weight == MERGE_NOISE) w = e * e / noise_variance(m, e, response_slope(r, c, z));
        else if (inside) w = 2 * fmin(z, top - z) / top;
        v->w = (float)w;
        v->wy = (float)(inside && weight == MERGE_DEBEVEC ? w * log(e) : 0);
    }
    ch->top = top;
    ch->clip = (float)response_edge(r, c, top);
    ch->safe = (int)response_forward(r, c, safe_share * ch->clip);
    ch->black = (float)response_edge(r, c, 1);
    ch->dim = (float)(ch->black + surely_no_noise * sqrt(noise_variance(m, 0, response_slope(r, c, 1))));
}

/* Mean and variance of y given e and z < max; *clipped: the chance of z = max.  Codes are
 * summed over +-5 sigma, in steps when there are many. */
static void moments(const response *r, int c, const noise_model *m, double e, double *mean, double *var,
                    double *clipped)
{
    enum { MOST = 96 };
    int top = r->clip[c], at = (int)(response_forward(r, c, e) + 0.5);
    double slope = response_slope(r, c, at);
    noise_model before = *m; /* rounding comes out of the sum over codes itself */
    before.code_var = fmax(m->code_var - 1.0 / 12, 0);
    double sd = sqrt(fmax(noise_variance(&before, e, slope), 1e-30));
    *clipped = 1 - normal_cdf((response_edge(r, c, top) - e) / sd);
    int lo = (int)floor(response_forward(r, c, e - 5 * sd)) - 1;
    int hi = (int)ceil(response_forward(r, c, e + 5 * sd)) + 1;
    lo = lo < 0 ? 0 : lo;
    hi = hi > top - 1 ? top - 1 : hi;
    int step = 1 + (hi - lo) / MOST;
    double p0 = lo == 0 ? 0 : normal_cdf((response_edge(r, c, lo) - e) / sd);
    double sum = 0, first = 0, second = 0;
    for (int z = lo; z <= hi; z += step) {
        int next = z + step > hi ? hi + 1 : z + step, mid = (z + next - 1) / 2;
        double p1 = normal_cdf((response_edge(r, c, next) - e) / sd), p = p1 - p0;
        double y = r->finv[c][mid];
        sum += p;
        first += p * y;
        second += p * y * y;
        p0 = p1;
    }
    double rounding = slope * slope / 12;
    if (sum > 1e-6) {
        *mean = first / sum;
        *var = fmax(second / sum - *mean * *mean, 0);
    } else {
        *mean = e;
        *var = noise_variance(m, e, slope);
    }
    /* where noise is under one code the recorded code is all but certain: what is left of the
     * rounding is unknown to the merge, so it counts as noise with the mean undisturbed */
    if (sd < 0.6 * slope) {
        *mean = e;
        *var = sd * sd + rounding;
    }
    *var = fmax(*var, 1e-12 * e * e);
}

static void expectations(merge_channel *ch, const response *r, int c, const noise_model *m, int lifted)
{
    double mean[CELLS], var[CELLS], clipped[CELLS], e[CELLS];
    for (int i = 0; i < CELLS; i++) {
        e[i] = exp2((i + 0.5) / GRID + grid_top_octave - OCTAVES);
        moments(r, c, m, e[i], &mean[i], &var[i], &clipped[i]);
        if (lifted && e[i] < 0.5 * ch->clip) {
            mean[i] = e[i];
            var[i] = noise_variance(m, e[i], response_slope(r, c, (int)(response_forward(r, c, e[i]) + 0.5)));
        }
    }
    for (int i = 0; i < CELLS; i++) {
        expectation *x = &ch->expect[i];
        int lo = i > 0 ? i - 1 : 0, hi = i < CELLS - 1 ? i + 1 : i;
        double slope = fmax((mean[hi] - mean[lo]) / (e[hi] - e[lo]), 0);
        double say = clipped[i] < most_clipped ? slope : 0;
        if (e[i] >= ch->clip) say = 0;
        x->weight = (float)(e[i] * e[i] * say / var[i]);
        x->info = (float)(e[i] * e[i] * say * slope / var[i]);
        x->mean = (float)(mean[i] / e[i]);
        x->sd = (float)(sqrt(var[i]) / e[i]);
        if (!isfinite(x->weight) || !isfinite(x->info) || !isfinite(x->mean) || !isfinite(x->sd))
            *x = (expectation){.mean = 1, .sd = 1}; /* a curve beyond reason: no say */
    }
}

/* expect[i].rest: an exposure at cell i has a say; those after it in m->order have, together, at most
 * the sum over steps of the smallest ratio between neighbours of the information there. */
static void bound_rest(const merge *m, merge_channel *ch)
{
    int step = CELLS;
    for (int s = 1; s < m->n; s++) {
        int d = m->offset[s - 1] - m->offset[s];
        step = d < step ? d : step;
    }
    for (int i = 0; i < CELLS; i++) {
        float sum = 0;
        int k = 1;
        for (; step > 0 && k < m->n && i - k * step >= 0; k++) sum += ch->expect[i - k * step].info;
        ch->expect[i].rest = step > 0 ? sum : INFINITY;
    }
}

void merge_free(merge *m)
{
    if (!m) return;
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) {
        free(m->ch[c].code);
        free(m->ch[c].expect);
    }
    free(m->order);
    free(m->rt);
    free(m->lnt);
    free(m->offset);
    free(m);
}

merge *merge_new(const response *r, const noise_model *noise, const double *exposure, int n,
                 merge_weight weight, int lifted, errmsg *e)
{
    merge *m = NULL;
    if (n > MERGE_MOST) {
        err_set(e, "expected at most %d images, found %d", MERGE_MOST, n);
        return NULL;
    }
    m = calloc(1, sizeof *m);
    if (m) {
        m->order = calloc((size_t)n, sizeof *m->order);
        m->rt = calloc((size_t)n, sizeof *m->rt);
        m->lnt = calloc((size_t)n, sizeof *m->lnt);
        m->offset = calloc((size_t)n, sizeof *m->offset);
    }
    if (!m || !m->order || !m->rt || !m->lnt || !m->offset) goto memory;
    m->n = n;
    m->channels = r->channels;
    m->max_code = r->max_code;
    m->weight = weight;
    m->tolerance = 0.06f;
    for (int k = 0; k < n; k++) {
        int s = 0;
        for (int i = 0; i < n; i++) s += exposure[i] > exposure[k] || (exposure[i] == exposure[k] && i < k);
        m->order[s] = k;
        m->rt[s] = (float)(1 / exposure[k]);
        m->lnt[s] = (float)log(exposure[k]);
        m->offset[s] = (int)lrint(log2(exposure[k]) * GRID);
    }
    for (int c = 0; c < r->channels; c++) {
        merge_channel *ch = &m->ch[c];
        ch->code = calloc((size_t)r->max_code + 1, sizeof *ch->code);
        ch->expect = calloc(CELLS, sizeof *ch->expect);
        if (!ch->code || !ch->expect) goto memory;
        code_values(ch, r, c, &noise[c], weight);
        expectations(ch, r, c, &noise[c], lifted);
        bound_rest(m, ch);
    }
    return m;
memory:
    merge_free(m);
    err_set(e, "out of memory for the merge of %d exposures", n);
    return NULL;
}
