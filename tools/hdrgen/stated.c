/*
 * stated.c - see stated.h.  The step between two exposures is the median of log2 y_l/y_k over the sample
 * pixels that are well inside the scale in both.
 */
#include "stated.h"

#include <math.h>
#include <stdlib.h>

enum { LEAST = 40 };
static const double dark = 0.02, bright = 0.9; /* of the clipped code: well inside */

static double light(double v, int linear)
{
    if (linear) return v;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Stops from exposure k to l; NAN where too few pixels say so. */
static double step(const samples *s, int k, int l, int linear, double *work)
{
    int n = 0;
    for (int c = 0; c < s->channels; c++)
        for (int i = 0; i < s->n[c]; i++) {
            size_t at = (size_t)i * (size_t)s->exposures;
            double a = (double)s->z[c][at + (size_t)k] / s->clip[c],
                   b = (double)s->z[c][at + (size_t)l] / s->clip[c];
            int gone = s->gone[c] && (s->gone[c][at + (size_t)k] || s->gone[c][at + (size_t)l]);
            if (!gone && a > dark && a < bright && b > dark && b < bright)
                work[n++] = log2(light(b, linear) / light(a, linear));
        }
    if (n < LEAST) return NAN;
    qsort(work, (size_t)n, sizeof *work, by_value);
    return work[n / 2];
}

/* Mean light of exposure k. */
static double mean_light(const samples *s, int k, int linear)
{
    double sum = 0, n = 0;
    for (int c = 0; c < s->channels; c++)
        for (int i = 0; i < s->n[c]; i++, n++) {
            double v = (double)s->z[c][(size_t)i * (size_t)s->exposures + (size_t)k] / s->clip[c];
            sum += light(v < 1 ? v : 1, linear);
        }
    return n > 0 && sum > 0 ? sum / n : 1e-9;
}

/* Stops between the darkest and the brightest of images of one exposure; clipped pixels make it less than it
 * is. */
static double span_of_equals(const samples *s, int linear)
{
    double low = INFINITY, high = 0;
    for (int k = 0; k < s->exposures; k++) {
        double v = mean_light(s, k, linear);
        low = fmin(low, v);
        high = fmax(high, v);
    }
    return log2(high / low);
}

void stated_check(stated_facts *f, const samples *s, const double *exposure, int linear)
{
    size_t most = 0;
    double worst = 0;
    *f = (stated_facts){0};
    for (int c = 0; c < s->channels; c++) most += (size_t)s->n[c];
    double *work = malloc((most + 1) * sizeof *work);
    for (int k = 1; work && k < s->exposures; k++) {
        double says = log2(exposure[k] / exposure[k - 1]), shows = step(s, k - 1, k, linear, work);
        if (isnan(shows)) continue;
        double off = fabs(shows - says);
        int wrong = linear ? off > 0.25 + 0.1 * says
                           : (says > 0.3 && shows < 0.15 * says) || (says > 0.1 && shows < -0.1) ||
                                 (says < 0.1 && off > 0.4);
        if (wrong && off > worst) {
            worst = off;
            f->worst = k;
            f->says = says;
            f->shows = shows;
        }
    }
    if (s->exposures > 1 && exposure[s->exposures - 1] < 1.000001 * exposure[0])
        f->span = span_of_equals(s, linear);
    free(work);
}
