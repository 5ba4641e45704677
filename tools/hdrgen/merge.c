/*
 * merge.c - the row kernels.
 *
 * Noise weights: X0 is y/t of the longest exposure that is not near clipping, or of the shortest if all
 * are; then Fisher-scoring steps of the quasi-likelihood with everything but y taken from X0,
 *
 *     d ln X = sum w(e_k) (y_k/e_k - m(e_k)/e_k) / sum i(e_k),   e_k = X0 t_k,
 *
 * whose denominator is the information on ln X: sigma = X / sqrt(sum i).  Weights do not depend on a
 * sample's own noise, so dark samples are not favoured for being dark (Granados et al. 2010, sec.
 * 4).  The step has a second solution where a sample near the top may be clipped; the likelier one is
 * taken, whatever X0 was.
 *
 * Debevec weights: ln X = sum w(z) (g(z) - ln t) / sum w(z), Debevec & Malik (1997), eq. 6.
 */
#include "merge.h"

#include <float.h>
#include <math.h>

#include "merge_internal.h"

enum { MAX_STEPS = 6 };
static const float negligible = 0.001f; /* share of the information that may be left out */
static const float sure = 6;            /* sigmas: nothing else is likelier */

static inline int is_missing(const merge_row *row, int i, int k)
{
    return row->missing && row->missing[k] && row->missing[k][(size_t)i * row->missing_stride];
}

static inline int is_rejected(const merge_row *row, int i, int k)
{
    return row->reject && k < 64 && (row->reject[i] >> k & 1u);
}

/* No sample had a say: the bounds that black and clipped samples set. */
static void bound(const merge *m, const merge_channel *ch, const merge_row *row, int i, float *x, float *sd,
                  uint8_t *flag)
{
    float lower = 0, upper = INFINITY;
    size_t at = (size_t)i * row->stride;
    int there = 0;
    for (int s = 0; s < m->n; s++) {
        int z = row->codes[m->order[s]][at];
        if (is_missing(row, i, m->order[s])) continue;
        there = 1;
        if (z >= ch->top) lower = fmaxf(lower, ch->clip * m->rt[s]);
        else upper = fminf(upper, fmaxf(ch->code[z].y, ch->black) * m->rt[s]);
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
        if (z <= top && z > 0 && (!with_reject || counts(row, i, m->order[s]))) return s;
    }
    return -1;
}

/* Where `first`, the longest exposure that is inside, is so dim that noise alone can have made it: the
 * longest that is black before it, which says more.  Else `first`: a longer one that is black by mistake
 * says nothing. */
static inline int black_before(const merge *m, const merge_channel *ch, const uint16_t *const *codes,
                               const merge_row *row, int i, size_t at, int with_reject, int first, float dark)
{
    if (first <= 0 || ch->code[codes[first][at]].y - dark > ch->dim) return first;
    for (int s = 0; s < first; s++)
        if (codes[s][at] == 0 && (!with_reject || counts(row, i, m->order[s]))) return s;
    return first;
}

/* One pixel of one channel on its way to a solution. */
typedef struct pixel {
    const uint16_t *const *codes; /* by place in m->order */
    const merge_row *row;
    int i, from; /* which pixel; the first place that is looked at */
    size_t at;
    float dark, info; /* info: on ln x, at the solution */
    uint8_t used;
} pixel;

/* Fisher scoring from x on; returns the solution. */
static inline float solve(const merge *m, const merge_channel *ch, pixel *p, int with_reject, float x)
{
    const int base = (OCTAVES - grid_top_octave) * GRID;
    for (int step = 0; step < MAX_STEPS; step++) {
        float score = 0, rx = 1 / x, info = 0;
        int cell = cell_of(x) + base;
        p->used = 0;
        for (int s = p->from; s < m->n; s++) {
            const codeval *v = &ch->code[p->codes[s][p->at]];
            const expectation *e = &ch->expect[clamp_cell(cell + m->offset[s])];
            float on = v->valid;
            if (with_reject && !counts(p->row, p->i, m->order[s])) on = 0;
            score += on * e->weight * ((v->y - p->dark) * rx * m->rt[s] - e->mean);
            info += on * e->info;
            p->used = (uint8_t)(p->used + (on * e->info > 0.25f));
            if (e->rest < negligible * info) /* all that follow know less than that together */
                break;
        }
        p->info = info;
        if (!(info > 1e-6f)) break;
        float d = score / info;
        d = d < -0.5f ? -0.5f : d > 1 ? 1 : d;
        x += x * d;
        if (fabsf(d) < 0.02f) break;
    }
    return x;
}

/* ln likelihood of x: each sample as the tables expect it, or, rarely, anything at all.  A clipped sample
 * may read as one that is nearly so. */
static float likelihood(const merge *m, const merge_channel *ch, const pixel *p, int with_reject, float x)
{
    static const float anything = 1e-3f, not_white = 0.1f;
    static const float depth = 0.03f; /* so far below the top, about, clipped pixels come out */
    const int base = (OCTAVES - grid_top_octave) * GRID, cell = cell_of(x) + base;
    const float root_2pi = 2.5066f;
    float sum = 0;
    for (int s = p->from; s < m->n; s++) {
        if (with_reject && !counts(p->row, p->i, m->order[s])) continue;
        int z = p->codes[s][p->at];
        const expectation *q = &ch->expect[clamp_cell(cell + m->offset[s])];
        float e = x / m->rt[s], like, sd = q->sd * e + 1e-30f;
        if (z >= ch->top ||
            z == 0) { /* what lies beyond an edge, by a logistic curve in place of the normal's */
            float beyond = z ? (e - ch->clip) / sd : (ch->black - e - p->dark) / sd;
            like = 1 / (1 + expf(-1.7f * fminf(fmaxf(beyond, -40), 40)));
        } else if (e >= ch->clip) {
            like = not_white / (depth * ch->clip) * expf((ch->code[z].y - ch->clip) / (depth * ch->clip));
        } else {
            float r = (ch->code[z].y - p->dark - q->mean * e) / sd;
            like = expf(-0.5f * fminf(r * r, 80)) / (root_2pi * sd);
        }
        sum += logf((1 - anything) * like + anything / ch->clip);
    }
    return sum;
}

/* The scoring ends at the solution nearest to its start, and there are two where samples near the top
 * may be light or clipped: x, from the sample at place `guess`, makes all longer ones clipped.  The
 * likeliest of x and what these say on their own is where to end. */
static float likeliest(const merge *m, const merge_channel *ch, pixel *p, int with_reject, int first,
                       int guess, float x)
{
    float best = likelihood(m, ch, p, with_reject, x), start = 0;
    for (int s = first; s < guess; s++) {
        int z = p->codes[s][p->at];
        if (z <= ch->safe || z >= ch->top || (with_reject && !counts(p->row, p->i, m->order[s]))) continue;
        float other = (ch->code[z].y - p->dark) * m->rt[s];
        float like = other > 0 ? likelihood(m, ch, p, with_reject, other) : -INFINITY;
        if (like > best) {
            best = like;
            start = other;
        }
    }
    return start > 0 ? solve(m, ch, p, with_reject, start) : x;
}

/* The shortest exposure with a sample between black and clipped. */
static inline int last_inside(const merge *m, const merge_channel *ch, const pixel *p, int with_reject)
{
    for (int s = m->n - 1; s >= 0; s--) {
        int z = p->codes[s][p->at];
        if (z > 0 && z < ch->top && (!with_reject || counts(p->row, p->i, m->order[s]))) return s;
    }
    return -1;
}

static inline void noise_row(const merge *m, const merge_channel *ch, const merge_row *row, int with_pedestal,
                             int with_reject)
{
    const codeval *code = ch->code;
    const int n = m->n;
    const uint16_t *codes[MERGE_MOST];
    for (int s = 0; s < n; s++) codes[s] = row->codes[m->order[s]];
    pixel p = {.codes = codes, .row = row};
    for (int i = 0; i < row->count; i++) {
        size_t at = (size_t)i * row->stride, to = (size_t)i * row->out_stride;
        float x = 0, sd;
        uint8_t flag = 0;
        p.i = i;
        p.at = at;
        p.dark = with_pedestal ? row->pedestal[at] : 0;
        p.used = 0;
        int first = first_inside(m, codes, row, i, at, with_reject, 0, ch->top - 1), guess = first;
        /* a camera's clipped pixels may come out a little below the highest code: begin from one that is
         * not near it, else from the shortest, and the longer ones get the weight that its prediction
         * gives them */
        if (first >= 0 && codes[first][at] > ch->safe) {
            guess = first_inside(m, codes, row, i, at, with_reject, first + 1, ch->safe);
            guess = guess < 0 ? last_inside(m, ch, &p, with_reject) : guess;
        }
        int from = p.from = black_before(m, ch, codes, row, i, at, with_reject, first, p.dark);
        if (from < first) x = ch->black * m->rt[from];
        else if (guess >= 0) x = (code[codes[guess][at]].y - p.dark) * m->rt[guess];
        for (int k = 0; with_reject && k < n; k++)
            if (is_rejected(row, i, k)) flag = MERGE_GHOST;
        if (!(x > 0)) {
            bound(m, ch, row, i, &x, &sd, &flag);
        } else {
            x = solve(m, ch, &p, with_reject, x);
            float lowest = from == first && guess != first ? ch->clip * m->rt[first] : INFINITY;
            if (x > lowest && x - lowest < sure * x / sqrtf(p.info + 1e-6f))
                x = likeliest(m, ch, &p, with_reject, first, guess, x);
            if (!(x > 0 && x < FLT_MAX) || (from < first && x < ch->black * m->rt[from]))
                bound(m, ch, row, i, &x, &sd, &flag);
            sd = p.info > 1 ? x / sqrtf(p.info) : x;
            p.used = p.used ? p.used : 1; /* all are weak, together they say something */
        }
        row->radiance[to] = x;
        if (row->sigma) row->sigma[to] = sd;
        if (row->used) row->used[i] = p.used;
        if (row->flags) row->flags[i] = flag;
    }
}

/* Exposures longer than this can have nothing but clipped samples of a pixel: found from the longest
 * sample that is not near the top, or else the shortest, if it is well known.  1/t, so that 0 is no
 * limit. */
static float clips_from(const merge *m, const merge_channel *ch, const merge_row *row,
                        const uint16_t *const *codes, int i, size_t at)
{
    static const float well_known = 25; /* information on ln x: 20 % */
    pixel p = {.codes = codes, .row = row, .i = i, .at = at};
    const int base = (OCTAVES - grid_top_octave) * GRID;
    int s = first_inside(m, codes, row, i, at, 1, 0, ch->safe);
    s = s < 0 ? last_inside(m, ch, &p, 1) : s;
    float y = s < 0 ? 0 : ch->code[codes[s][at]].y - (row->pedestal ? row->pedestal[at] : 0);
    if (!(y > 0) || (codes[s][at] <= ch->safe && ch->expect[clamp_cell(cell_of(y) + base)].info < well_known))
        return 0;
    return y * m->rt[s] / ch->clip;
}

/* Exposures shorter than this see nothing but noise of the pixel, whose logarithms are too bright by far
 * where a code is a fraction of the noise (camera raw); the longest one counts in any case.  1/t. */
static float faint_from(const merge *m, const merge_channel *ch, float clips)
{
    float limit = clips * ch->clip / ch->dim;
    return limit >= m->rt[0] ? limit : INFINITY;
}

static void debevec_row(const merge *m, const merge_channel *ch, const merge_row *row)
{
    const int base = (OCTAVES - grid_top_octave) * GRID;
    const uint16_t *codes[MERGE_MOST];
    for (int s = 0; s < m->n; s++) codes[s] = row->codes[m->order[s]];
    for (int i = 0; i < row->count; i++) {
        size_t at = (size_t)i * row->stride, to = (size_t)i * row->out_stride;
        float num = 0, den = 0, scatter = 0, x, sd, clips = clips_from(m, ch, row, codes, i, at);
        float faint = faint_from(m, ch, clips);
        uint8_t flag = 0, used = 0;
        for (int s = 0; s < m->n; s++) {
            int k = m->order[s];
            const codeval *v = &ch->code[row->codes[k][at]];
            if (!counts(row, i, k)) {
                flag |= is_rejected(row, i, k) ? MERGE_GHOST : 0;
                continue;
            }
            float w = v->w, wy = v->wy;
            if ((codes[s][at] > ch->safe && m->rt[s] < clips) || m->rt[s] > faint) continue;
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
                if (counts(row, i, m->order[s]) && (codes[s][at] <= ch->safe || m->rt[s] >= clips) &&
                    m->rt[s] <= faint)
                    scatter += v->w * v->w * one * one;
            }
            sd = x * fminf(sqrtf(scatter) / den, 1);
        }
        row->radiance[to] = x;
        if (row->sigma) row->sigma[to] = sd;
        if (row->used) row->used[i] = used;
        if (row->flags) row->flags[i] = flag;
    }
}

void merge_do_row(const merge *m, int channel, const merge_row *row)
{
    const merge_channel *ch = &m->ch[channel];
    if (m->weight == MERGE_DEBEVEC) debevec_row(m, ch, row);
    else if (row->pedestal) noise_row(m, ch, row, 1, row->reject || row->missing);
    else if (row->reject || row->missing) noise_row(m, ch, row, 0, 1);
    else noise_row(m, ch, row, 0, 0);
}
