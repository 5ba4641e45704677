/*
 * merge.c - the row kernels.
 *
 * Noise weights: X0 is the mean of y/t with inverse-variance weights read off the samples; then
 * Fisher-scoring steps of the quasi-likelihood with everything but y taken from X0,
 *
 *     d ln X = sum w(e_k) (y_k/e_k - m(e_k)/e_k) / sum i(e_k),   e_k = X0 t_k,
 *
 * whose denominator is the information on ln X: sigma = X / sqrt(sum i).  Weights do not depend on a
 * sample's own noise, so dark samples are not favoured for being dark (Granados et al. 2010, sec. 4).
 *
 * Debevec weights: ln X = sum w(z) (g(z) - ln t) / sum w(z), Debevec & Malik (1997), eq. 6.
 */
#include "merge.h"

#include <math.h>
#include <string.h>

#include "merge_internal.h"

enum { MAX_STEPS = 6 };

/* No sample had a say: the bounds that black and clipped samples set. */
static void bound(const merge *m, const merge_channel *ch, const merge_row *row, int i,
                  float *x, float *sd, uint8_t *flag)
{
    float lower = 0, upper = INFINITY;
    size_t at = (size_t)i * row->stride;
    for (int k = 0; k < m->n; k++) {
        int z = row->codes[k][at];
        if (z == m->max_code)
            lower = fmaxf(lower, ch->clip * m->rt[k]);
        else
            upper = fminf(upper, fmaxf(ch->code[z].y, ch->black) * m->rt[k]);
    }
    if (isinf(upper)) {
        *x = *sd = lower;
        *flag |= MERGE_CLIPPED;
    } else if (lower <= 0) {
        *x = *sd = upper;
        *flag |= MERGE_BLACK;
    } else {
        *x = sqrtf(lower) * sqrtf(upper);
        *sd = 0.5f * fabsf(upper - lower);
        *flag |= MERGE_GAP;
    }
}

static inline int counts(const merge_row *row, int i, int k)
{
    return !row->reject || k > 63 || !(row->reject[i] >> k & 1u);
}

static inline void noise_row(const merge *m, const merge_channel *ch, const merge_row *row,
                             int with_pedestal, int with_reject)
{
    const codeval *code = ch->code;
    const int base = (OCTAVES - grid_top_octave) * GRID, n = m->n;
    for (int i = 0; i < row->count; i++) {
        size_t at = (size_t)i * row->stride, to = (size_t)i * row->out_stride;
        float num = 0, den = 0, x, sd, dark = with_pedestal ? row->pedestal[at] : 0;
        uint8_t flag = 0, used = 0;
        for (int k = 0; k < n; k++) {
            const codeval *v = &code[row->codes[k][at]];
            if (with_reject && !counts(row, i, k)) {
                flag |= MERGE_GHOST;
                continue;
            }
            num += (v->wy - (with_pedestal ? v->w * dark : 0)) * m->rt[k];
            den += v->w;
        }
        if (!(den > 0) || !(num > 0)) {
            bound(m, ch, row, i, &x, &sd, &flag);
        } else {
            float info = 0;
            x = num / den;
            for (int step = 0; step < MAX_STEPS; step++) {
                float score = 0, rx = 1 / x;
                int cell = cell_of(x) + base;
                info = 0;
                used = 0;
                for (int k = 0; k < n; k++) {
                    const codeval *v = &code[row->codes[k][at]];
                    const expectation *e = &ch->expect[clamp_cell(cell + m->offset[k])];
                    float on = v->valid;
                    if (with_reject && !counts(row, i, k))
                        on = 0;
                    score += on * e->weight * ((v->y - dark) * rx * m->rt[k] - e->mean);
                    info += on * e->info;
                    used = (uint8_t)(used + (on * e->info > 0.25f));
                }
                if (!(info > 1e-6f))
                    break;
                float d = score / info;
                d = d < -0.5f ? -0.5f : d > 1 ? 1 : d;
                x += x * d;
                if (fabsf(d) < 0.02f)
                    break;
            }
            sd = info > 1 ? x / sqrtf(info) : x;
        }
        row->radiance[to] = x;
        if (row->sigma)
            row->sigma[to] = sd;
        if (row->used)
            row->used[i] = used;
        if (row->flags)
            row->flags[i] = flag;
    }
}

static void debevec_row(const merge *m, const merge_channel *ch, const merge_row *row)
{
    const int base = (OCTAVES - grid_top_octave) * GRID;
    for (int i = 0; i < row->count; i++) {
        size_t at = (size_t)i * row->stride, to = (size_t)i * row->out_stride;
        float num = 0, den = 0, scatter = 0, x, sd;
        uint8_t flag = 0, used = 0;
        for (int k = 0; k < m->n; k++) {
            const codeval *v = &ch->code[row->codes[k][at]];
            if (row->reject && !counts(row, i, k)) {
                flag |= MERGE_GHOST;
                continue;
            }
            float w = v->w, wy = v->wy;
            if (row->pedestal && w > 0) {
                float y = v->y - row->pedestal[at];
                w = y > 0 ? w : 0;
                wy = y > 0 ? w * logf(y) : 0;
            }
            num += wy - w * m->lnt[k];
            den += w;
            used = (uint8_t)(used + (w > 0));
        }
        if (!(den > 0)) {
            bound(m, ch, row, i, &x, &sd, &flag);
        } else {
            x = expf(num / den);
            int cell = cell_of(x) + base;
            for (int k = 0; k < m->n; k++) { /* of a mean with these weights and the model's noise */
                const codeval *v = &ch->code[row->codes[k][at]];
                float s = ch->expect[clamp_cell(cell + m->offset[k])].sd;
                if (!row->reject || counts(row, i, k))
                    scatter += v->w * v->w * s * s;
            }
            sd = x * fminf(sqrtf(scatter) / den, 1);
        }
        row->radiance[to] = x;
        if (row->sigma)
            row->sigma[to] = sd;
        if (row->used)
            row->used[i] = used;
        if (row->flags)
            row->flags[i] = flag;
    }
}

void merge_do_row(const merge *m, int channel, const merge_row *row)
{
    const merge_channel *ch = &m->ch[channel];
    if (m->weight == MERGE_DEBEVEC)
        debevec_row(m, ch, row);
    else if (row->pedestal)
        noise_row(m, ch, row, 1, row->reject != NULL);
    else if (row->reject)
        noise_row(m, ch, row, 0, 1);
    else
        noise_row(m, ch, row, 0, 0);
}
