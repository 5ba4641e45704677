/*
 * debevec.c - Debevec & Malik, Recovering High Dynamic Range Radiance Maps from Photographs
 * (1997), eq. 3 and 4, with g on a spline.
 *
 * ln E of each pixel occurs in that pixel's rows only, so one reflection per pixel takes it out of the
 * system (qrls_add_eliminating); thousands of pixels then cost thousands of short rows, not columns.
 */
#include "debevec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "curve.h"
#include "noise.h"
#include "qrls.h"

enum { STRATA = 64, PER_STRATUM = 48, MIN_PIXELS = 8 };
static const double least_correlation = 0.5;

static int usable(int z, int max_code)
{
    return z > 0 && z < max_code;
}

/* Two samples of different exposure that are neither black nor clipped? */
static int informative(const uint16_t *z, const samples *s, const double *lnt)
{
    double lo = INFINITY, hi = -INFINITY;
    for (int k = 0; k < s->exposures; k++)
        if (usable(z[k], s->max_code)) {
            lo = fmin(lo, lnt[k]);
            hi = fmax(hi, lnt[k]);
        }
    return hi > lo;
}

/* Do two exposures that are neighbours in time see the same thing?  Where a long exposure shows a scene
 * and a short one only its read noise, both are inside the scale, but their codes don't correlate.
 * Returns the
 * number of such pairs, less those where the longer exposure is the darker one. */
static int overlapping(const samples *s, int c, const double *lnt)
{
    enum { LEAST = 8 };
    int pairs = 0;
    for (int k = 0; k < s->exposures; k++) {
        int next = -1; /* the next longer exposure */
        for (int i = 0; i < s->exposures; i++)
            if (lnt[i] > lnt[k] && (next < 0 || lnt[i] < lnt[next])) next = i;
        if (next < 0) continue;
        double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
        for (int i = 0; i < s->n[c]; i++) {
            const uint16_t *z = s->z[c] + (size_t)i * (size_t)s->exposures;
            if (s->out[c][i] || !usable(z[k], s->max_code) || !usable(z[next], s->max_code)) continue;
            double a = z[k], b = z[next];
            n++;
            sa += a;
            sb += b;
            aa += a * a;
            bb += b * b;
            ab += a * b;
        }
        double va = n * aa - sa * sa, vb = n * bb - sb * sb;
        if (n >= LEAST && va > 0 && vb > 0 && n * ab - sa * sb > least_correlation * sqrt(va * vb))
            pairs += sb >= sa ? 1 : -1;
    }
    return pairs;
}

/* Indices of up to STRATA*PER_STRATUM informative pixels spread over the range of brightness. */
static int stratify(int **chosen, const samples *s, int c, const double *lnt)
{
    int n = s->n[c], kept = 0;
    int count[STRATA] = {0}, seen[STRATA] = {0};
    double range = (double)s->exposures * s->max_code + 1;
    unsigned char *stratum = malloc((size_t)n + 1);
    *chosen = malloc(sizeof **chosen * (STRATA * PER_STRATUM + 1));
    if (!stratum || !*chosen) {
        free(stratum);
        free(*chosen);
        *chosen = NULL;
        return -1;
    }
    for (int i = 0; i < n; i++) {
        const uint16_t *z = s->z[c] + (size_t)i * (size_t)s->exposures;
        double sum = 0;
        for (int k = 0; k < s->exposures; k++) sum += z[k];
        stratum[i] = !s->out[c][i] && informative(z, s, lnt) ? (unsigned char)(sum / range * STRATA) : STRATA;
        if (stratum[i] < STRATA) count[stratum[i]]++;
    }
    for (int i = 0; i < n; i++) {
        int t = stratum[i];
        if (t == STRATA) continue;
        long at = seen[t]++, cap = PER_STRATUM;
        /* every count/cap-th one of the stratum */
        if (count[t] <= cap || (at + 1) * cap / count[t] > at * cap / count[t]) (*chosen)[kept++] = i;
    }
    free(stratum);
    return kept;
}

typedef struct fit {
    const samples *s;
    int c;
    const double *lnt;
    double lambda;
    const basis *b;
    const int *chosen; /* [n] pixels */
    int n;
    double *say; /* [n] weight of each pixel */
    double coef[BASIS_N], weight;
    qrls_facts facts;
} fit;

static double hat(const fit *f, int z)
{
    return 2 * fmin(z, f->s->clip[f->c] - z) / f->s->clip[f->c];
}

static int least_squares(fit *f, errmsg *e)
{
    const samples *s = f->s;
    int code = -1, m = BASIS_N + 1;
    qrls *q = qrls_new(BASIS_N);
    double *rows = malloc(sizeof *rows * (size_t)s->exposures * (size_t)m);
    double *u = malloc(sizeof *u * (size_t)s->exposures);
    f->weight = 0;
    if (!q || !rows || !u) {
        err_set(e, "out of memory");
        goto done;
    }
    for (int i = 0; i < f->n; i++) {
        const uint16_t *z = s->z[f->c] + (size_t)f->chosen[i] * (size_t)s->exposures;
        int used = 0;
        for (int k = 0; k < s->exposures; k++) {
            if (!usable(z[k], s->max_code)) continue;
            double w = f->say[i] * hat(f, z[k]), g[4];
            double *row = rows + (size_t)used * (size_t)m;
            int first = basis_eval(f->b, log(z[k]), 0, g);
            memset(row, 0, sizeof *row * (size_t)m);
            for (int j = 0; j < 4; j++) row[first + j] = w * g[j];
            row[BASIS_N] = w * f->lnt[k];
            u[used++] = w;
            f->weight += w * w;
        }
        if (f->say[i] > 0 && qrls_add_eliminating(q, rows, u, used)) {
            err_set(e, "least squares: LAPACK's QR factorisation failed");
            goto done;
        }
    }
    code = curve_penalty(q, f->b, f->lambda, NULL) || curve_gauge(q, f->b, sqrt(f->weight)) ||
                   qrls_solve(q, f->coef, 1e-13, &f->facts, e)
               ? -1
               : 0;
done:
    free(rows);
    free(u);
    qrls_free(q);
    return code;
}

/* ln exposure of each code, and its variance there by the noise model. */
static void tabulate(const fit *f, double *g, double *var)
{
    noise_model noise = noise_default();
    int top = f->s->clip[f->c];
    for (int z = 1; z <= top; z++) g[z] = basis_curve(f->b, f->coef, log(z));
    for (int z = 1; z < top; z++) {
        double ex = exp(g[z] - g[top]), slope = ex * (z > 1 ? 0.5 * (g[z + 1] - g[z - 1]) : g[2] - g[1]);
        var[z] = noise_variance(&noise, ex, slope) / (ex * ex);
    }
}

/* RMS over a pixel's samples of ln exposure about their weighted mean, over what noise makes of it. */
static double misfit(const fit *f, const double *g, const double *var, int i)
{
    const uint16_t *z = f->s->z[f->c] + (size_t)f->chosen[i] * (size_t)f->s->exposures;
    double sum = 0, mean = 0, square = 0, noise = 1e-12;
    for (int k = 0; k < f->s->exposures; k++)
        if (usable(z[k], f->s->max_code)) {
            double w = hat(f, z[k]), d = g[z[k]] - f->lnt[k];
            sum += w * w;
            mean += w * w * d;
            square += w * w * d * d;
            noise += w * w * var[z[k]];
        }
    return sum > 0 ? sqrt(fmax(square - mean * mean / sum, 0) / noise) : 0;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Pixels that contradict themselves lose their say, by iterated reweighting with a redescending weight
 * (Geman and
 * McClure's) about what is usual.  Returns the largest change of a weight; 0: too few stand out to matter. */
static double reweigh(fit *f, double *room)
{
    static const double wide = 3, stands_out = 6, few = 0.003;
    double change = 0, out = 0, *r = room, *sorted = r + f->n, *g = sorted + f->n,
           *var = g + f->s->max_code + 1;
    tabulate(f, g, var);
    for (int i = 0; i < f->n; i++) sorted[i] = r[i] = misfit(f, g, var, i);
    qsort(sorted, (size_t)f->n, sizeof *sorted, by_value);
    double usual = fmax(sorted[f->n / 2], 1e-6);
    for (int i = 0; i < f->n; i++) out += r[i] > stands_out * usual;
    for (int i = 0; i < f->n && out > few * f->n; i++) {
        double x = r[i] / (wide * usual), was = f->say[i];
        f->say[i] = 1 / ((1 + x * x) * (1 + x * x));
        change = fmax(change, fabs(f->say[i] - was));
    }
    return change;
}

static int one_channel(response *r, int c, solve_facts *facts, const samples *s, const double *lnt,
                       double lambda, const basis *b, errmsg *e)
{
    enum { MOST_PASSES = 12 };
    int *chosen = NULL, code = -1;
    int n = stratify(&chosen, s, c, lnt);
    fit f = {.s = s, .c = c, .lnt = lnt, .lambda = lambda, .b = b, .chosen = chosen, .n = n};
    double *room = n >= 0 ? malloc(sizeof *room * (3 * (size_t)n + 2 * (size_t)s->max_code + 3)) : NULL;
    f.say = room;
    if (!room) {
        err_set(e, "out of memory");
        goto done;
    }
    if (n < MIN_PIXELS) {
        err_set(e,
                "channel %d: expected at least %d pixels that are neither black nor clipped in two "
                "exposures of different time, found %d: give --response",
                c, MIN_PIXELS, n);
        goto done;
    }
    int pairs = overlapping(s, c, lnt);
    if (pairs < 0) {
        err_set(e,
                "channel %d: the longer exposures are the darker ones: times or order of the images wrong?",
                c);
        goto done;
    }
    if (pairs == 0) {
        err_set(
            e,
            "channel %d: expected two exposures that show the same things neither black nor clipped, found "
            "none: give --response",
            c);
        goto done;
    }
    for (int i = 0; i < n; i++) f.say[i] = 1;
    if (least_squares(&f, e)) goto done;
    for (int pass = 1; pass < MOST_PASSES && reweigh(&f, room + n) > 0.02; pass++)
        if (least_squares(&f, e)) goto done;
    int bad = curve_to_table(r, c, b, f.coef);
    if (bad) {
        if (bad == -2) err_set(e, "out of memory");
        else
            err_set(e,
                    "channel %d: the recovered response is not a curve: times or order of the images wrong?",
                    c);
        goto done;
    }
    facts->condition[c] = f.facts.condition;
    facts->residual[c] = sqrt(f.facts.rss / f.weight);
    facts->pixels[c] = n;
    code = 0;
done:
    free(chosen);
    free(room);
    return code;
}

int debevec_solve(response *r, solve_facts *facts, const samples *s, const double *lnt, double lambda,
                  errmsg *e)
{
    basis b;
    response got;
    memset(facts, 0, sizeof *facts);
    if (response_alloc(&got, s->channels, s->max_code, e)) return -1;
    memcpy(got.clip, s->clip, sizeof got.clip);
    basis_init(&b, response_top(&got));
    for (int c = 0; c < s->channels; c++)
        if (one_channel(&got, c, facts, s, lnt, lambda, &b, e)) {
            response_free(&got);
            return -1;
        }
    return response_recovered(r, &got, "debevec", e);
}
