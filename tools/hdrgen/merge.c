/*
 * merge.c - the row kernels.
 *
 * Noise weights: X0 is y/t of the longest exposure that is not near clipping; then Fisher-scoring steps of the
 * quasi-likelihood with everything but y taken from X0,
 *
 *     d ln X = sum w(e_k) (y_k/e_k - m(e_k)/e_k) / sum i(e_k),   e_k = X0 t_k,
 *
 * whose denominator is the information on ln X: sigma = X / sqrt(sum i).  Weights do not depend on a
 * sample's own noise, so dark samples are not favoured for being dark (Granados et al. 2010, sec. 4).
 *
 * Debevec weights: ln X = sum w(z) (g(z) - ln t) / sum w(z), Debevec & Malik (1997), eq. 6.
 */
#include "merge.h"

#include <float.h>
#include <math.h>

#include "merge_internal.h"

enum { MAX_STEPS = 6 };
static const float negligible = 0.001f; /* share of the information that may be left out */

static inline int is_missing(const merge_row *row, int i, int k)
{
    return row->missing && row->missing[k] && row->missing[k][(size_t)i * row->missing_stride];
}

static inline int is_rejected(const merge_row *row, int i, int k)
{
    return row->reject && k < 64 && (row->reject[i] >> k & 1u);
}

/* No sample had a say: the bounds that black and clipped samples set. */
static void bound(const merge *m, const merge_channel *ch, const merge_row *row, int i,
                  float *x, float *sd, uint8_t *flag)
{
    float lower = 0, upper = INFINITY;
    size_t at = (size_t)i * row->stride;
    int there = 0;
    for (int s = 0; s < m->n; s++) {
        int z = row->codes[m->order[s]][at];
        if (is_missing(row, i, m->order[s]))
            continue;
        there = 1;
        if (z == m->max_code)
            lower = fmaxf(lower, ch->clip * m->rt[s]);
        else
            upper = fminf(upper, fmaxf(ch->code[z].y, ch->black) * m->rt[s]);
    }
    if (!there) {
        *x = *sd = 0;
        *flag |= MERGE_MISSING;
    } else if (isinf(upper)) {
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
    return !is_rejected(row, i, k) && !is_missing(row, i, k);
}

/* The longest exposure with a sample from 1 to top, at place `from` in m->order or later; or -1. */
static inline int first_inside(const merge *m, const uint16_t *const *codes, const merge_row *row, int i,
                               size_t at, int with_reject, int from, int top)
{
    for (int s = from; s < m->n; s++) {
        int z = codes[s][at];
        if (z <= top && z > 0 && (!with_reject || counts(row, i, m->order[s])))
            return s;
    }
    return -1;
}

/* Where `first`, the longest exposure that is inside, is so dim that noise alone can have made it: the longest that is
 * black before it, which says more.  Else `first`: a longer one that is black by mistake says nothing. */
static inline int black_before(const merge *m, const merge_channel *ch, const uint16_t *const *codes, const merge_row *row, int i, size_t at,
                               int with_reject, int first, float dark)
{
    if (first <= 0 || ch->code[codes[first][at]].y - dark > ch->dim)
        return first;
    for (int s = 0; s < first; s++)
        if (codes[s][at] == 0 && (!with_reject || counts(row, i, m->order[s])))
            return s;
    return first;
}

static inline void noise_row(const merge *m, const merge_channel *ch, const merge_row *row,
                             int with_pedestal, int with_reject)
{
    const codeval *code = ch->code;
    const int base = (OCTAVES - grid_top_octave) * GRID, n = m->n;
    const uint16_t *codes[MERGE_MOST];
    for (int s = 0; s < n; s++)
        codes[s] = row->codes[m->order[s]];
    for (int i = 0; i < row->count; i++) {
        size_t at = (size_t)i * row->stride, to = (size_t)i * row->out_stride;
        float x = 0, sd, dark = with_pedestal ? row->pedestal[at] : 0;
        uint8_t flag = 0, used = 0;
        int first = first_inside(m, codes, row, i, at, with_reject, 0, m->max_code - 1), guess = first;
        /* a camera's clipped pixels may come out a little below the highest code: begin from one that is not near
         * it, and the longer ones get the weight that its prediction gives them */
        if (first >= 0 && codes[first][at] > ch->safe)
            guess = first_inside(m, codes, row, i, at, with_reject, first + 1, ch->safe);
        guess = guess < 0 ? first : guess;
        int from = black_before(m, ch, codes, row, i, at, with_reject, first, dark);
        if (from < first)
            x = ch->black * m->rt[from];
        else if (guess >= 0)
            x = (code[codes[guess][at]].y - dark) * m->rt[guess];
        for (int k = 0; with_reject && k < n; k++)
            if (is_rejected(row, i, k))
                flag = MERGE_GHOST;
        if (!(x > 0)) {
            bound(m, ch, row, i, &x, &sd, &flag);
        } else {
            float info = 0;
            for (int step = 0; step < MAX_STEPS; step++) {
                float score = 0, rx = 1 / x;
                int cell = cell_of(x) + base;
                info = 0;
                used = 0;
                for (int s = from; s < n; s++) {
                    const codeval *v = &code[codes[s][at]];
                    const expectation *e = &ch->expect[clamp_cell(cell + m->offset[s])];
                    float on = v->valid;
                    if (with_reject && !counts(row, i, m->order[s]))
                        on = 0;
                    score += on * e->weight * ((v->y - dark) * rx * m->rt[s] - e->mean);
                    info += on * e->info;
                    used = (uint8_t)(used + (on * e->info > 0.25f));
                    if (e->rest < negligible * info) /* all that follow know less than that together */
                        break;
                }
                if (!(info > 1e-6f))
                    break;
                float d = score / info;
                d = d < -0.5f ? -0.5f : d > 1 ? 1 : d;
                x += x * d;
                if (fabsf(d) < 0.02f)
                    break;
            }
            if (!(x > 0 && x < FLT_MAX) || (from < first && x < ch->black * m->rt[from]))
                bound(m, ch, row, i, &x, &sd, &flag);
            sd = info > 1 ? x / sqrtf(info) : x;
            used = used ? used : 1; /* all are weak, together they say something */
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
        for (int s = 0; s < m->n; s++) {
            int k = m->order[s];
            const codeval *v = &ch->code[row->codes[k][at]];
            if (!counts(row, i, k)) {
                flag |= is_rejected(row, i, k) ? MERGE_GHOST : 0;
                continue;
            }
            float w = v->w, wy = v->wy;
            if (row->pedestal && w > 0) {
                float y = v->y - row->pedestal[at];
                w = y > 0 ? w : 0;
                wy = y > 0 ? w * logf(y) : 0;
            }
            num += wy - w * m->lnt[s];
            den += w;
            used = (uint8_t)(used + (w > 0));
        }
        if (!(den > 0)) {
            bound(m, ch, row, i, &x, &sd, &flag);
        } else {
            x = expf(num / den);
            int cell = cell_of(x) + base;
            for (int s = 0; s < m->n; s++) { /* of a mean with these weights and the model's noise */
                const codeval *v = &ch->code[row->codes[m->order[s]][at]];
                float one = ch->expect[clamp_cell(cell + m->offset[s])].sd;
                if (counts(row, i, m->order[s]))
                    scatter += v->w * v->w * one * one;
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
        noise_row(m, ch, row, 1, row->reject || row->missing);
    else if (row->reject || row->missing)
        noise_row(m, ch, row, 0, 1);
    else
        noise_row(m, ch, row, 0, 0);
}
