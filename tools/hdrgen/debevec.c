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
 * and a short one only its read noise, both are inside the scale, but their codes don't correlate.  Returns the
 * number of such pairs, less those where the longer exposure is the darker one. */
static int overlapping(const samples *s, int c, const double *lnt)
{
    enum { LEAST = 8 };
    int pairs = 0;
    for (int k = 0; k < s->exposures; k++) {
        int next = -1; /* the next longer exposure */
        for (int i = 0; i < s->exposures; i++)
            if (lnt[i] > lnt[k] && (next < 0 || lnt[i] < lnt[next]))
                next = i;
        if (next < 0)
            continue;
        double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
        for (int i = 0; i < s->n[c]; i++) {
            const uint16_t *z = s->z[c] + (size_t)i * (size_t)s->exposures;
            if (!usable(z[k], s->max_code) || !usable(z[next], s->max_code))
                continue;
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
        for (int k = 0; k < s->exposures; k++)
            sum += z[k];
        stratum[i] = informative(z, s, lnt) ? (unsigned char)(sum / range * STRATA) : STRATA;
        if (stratum[i] < STRATA)
            count[stratum[i]]++;
    }
    for (int i = 0; i < n; i++) {
        int t = stratum[i];
        if (t == STRATA)
            continue;
        long at = seen[t]++, cap = PER_STRATUM;
        /* every count/cap-th one of the stratum */
        if (count[t] <= cap || (at + 1) * cap / count[t] > at * cap / count[t])
            (*chosen)[kept++] = i;
    }
    free(stratum);
    return kept;
}

static int one_channel(response *r, int c, solve_facts *facts, const samples *s,
                       const double *lnt, double lambda, const basis *b, errmsg *e)
{
    int *chosen = NULL, k, code = -1, m = BASIS_N + 1;
    int n = stratify(&chosen, s, c, lnt);
    qrls *q = qrls_new(BASIS_N);
    double *rows = malloc(sizeof *rows * (size_t)s->exposures * (size_t)m);
    double *u = malloc(sizeof *u * (size_t)s->exposures);
    double coef[BASIS_N], weight = 0;
    qrls_facts qf;
    if (n < 0 || !q || !rows || !u) {
        err_set(e, "out of memory");
        goto done;
    }
    if (n < MIN_PIXELS) {
        err_set(e, "channel %d: expected at least %d pixels that are neither black nor clipped in two "
                "exposures of different time, found %d: give --response", c, MIN_PIXELS, n);
        goto done;
    }
    int pairs = overlapping(s, c, lnt);
    if (pairs < 0) {
        err_set(e, "channel %d: the longer exposures are the darker ones: times or order of the images wrong?", c);
        goto done;
    }
    if (pairs == 0) {
        err_set(e, "channel %d: expected two exposures that show the same things neither black nor clipped, found "
                "none: give --response", c);
        goto done;
    }
    for (int i = 0; i < n; i++) {
        const uint16_t *z = s->z[c] + (size_t)chosen[i] * (size_t)s->exposures;
        int used = 0;
        for (k = 0; k < s->exposures; k++) {
            if (!usable(z[k], s->max_code))
                continue;
            double w = 2 * fmin(z[k], s->clip[c] - z[k]) / s->clip[c], f[4];
            double *row = rows + (size_t)used * (size_t)m;
            int first = basis_eval(b, log(z[k]), 0, f);
            memset(row, 0, sizeof *row * (size_t)m);
            for (int j = 0; j < 4; j++)
                row[first + j] = w * f[j];
            row[BASIS_N] = w * lnt[k];
            u[used++] = w;
            weight += w * w;
        }
        if (qrls_add_eliminating(q, rows, u, used)) {
            err_set(e, "least squares: LAPACK's QR factorisation failed");
            goto done;
        }
    }
    if (curve_penalty(q, b, lambda, NULL) || curve_gauge(q, b, sqrt(weight)) ||
        qrls_solve(q, coef, 1e-13, &qf, e))
        goto done;
    if (curve_to_table(r, c, b, coef)) {
        err_set(e, "channel %d: the recovered response is not a curve: times or order of the images wrong?", c);
        goto done;
    }
    facts->condition[c] = qf.condition;
    facts->residual[c] = sqrt(qf.rss / weight);
    facts->pixels[c] = n;
    code = 0;
done:
    free(chosen);
    free(rows);
    free(u);
    qrls_free(q);
    return code;
}

int debevec_solve(response *r, solve_facts *facts, const samples *s, const double *lnt,
                  double lambda, errmsg *e)
{
    basis b;
    response got;
    memset(facts, 0, sizeof *facts);
    if (response_alloc(&got, s->channels, s->max_code, e))
        return -1;
    memcpy(got.clip, s->clip, sizeof got.clip);
    basis_init(&b, response_top(&got));
    for (int c = 0; c < s->channels; c++)
        if (one_channel(&got, c, facts, s, lnt, lambda, &b, e)) {
            response_free(&got);
            return -1;
        }
    if (response_normalise(&got)) {
        response_free(&got);
        return err_set(e, "the recovered responses of the channels have nothing in common: times or order of the images wrong?");
    }
    strcpy(got.origin, "debevec");
    *r = got;
    return 0;
}
