/*
 * response.c - tables of inverse response curves: formulas, monotonicity, gauge, lookups.
 */
#include "response.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int response_alloc(response *r, int channels, int max_code, errmsg *e)
{
    memset(r, 0, sizeof *r);
    r->channels = channels;
    r->max_code = max_code;
    for (int c = 0; c < channels; c++) {
        r->clip[c] = max_code;
        r->finv[c] = calloc((size_t)max_code + 1, sizeof *r->finv[c]);
        if (!r->finv[c]) {
            response_free(r);
            return err_set(e, "out of memory for a response of %d codes", max_code + 1);
        }
    }
    return 0;
}

void response_free(response *r)
{
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) free(r->finv[c]);
    memset(r, 0, sizeof *r);
}

static int by_formula(response *r, int channels, int max_code, double (*f)(double, double), double arg,
                      const char *origin, errmsg *e)
{
    if (response_alloc(r, channels, max_code, e)) return -1;
    for (int c = 0; c < channels; c++)
        for (int z = 0; z <= max_code; z++) r->finv[c][z] = f((double)z / max_code, arg);
    snprintf(r->origin, sizeof r->origin, "%s", origin);
    return 0;
}

static double srgb_inverse(double v, double unused)
{
    (void)unused;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

int response_linear(response *r, int channels, int max_code, errmsg *e)
{
    return by_formula(r, channels, max_code, pow, 1, "linear", e);
}

int response_srgb(response *r, int channels, int max_code, errmsg *e)
{
    return by_formula(r, channels, max_code, srgb_inverse, 0, "srgb", e);
}

int response_gamma(response *r, int channels, int max_code, double g, errmsg *e)
{
    char origin[64];
    if (!(g >= 0.1 && g <= 10)) return err_set(e, "gamma: expected an exponent from 0.1 to 10, found %g", g);
    snprintf(origin, sizeof origin, "gamma:%g", g);
    return by_formula(r, channels, max_code, pow, g, origin, e);
}

int response_make_monotone(response *r, int c)
{
    double *f = r->finv[c];
    int n = r->max_code, changed = 0;
    for (int z = 1; z <= n; z++)
        if (!(f[z] > 0) || !isfinite(f[z])) return -1;
    /* blocks of pooled codes: end[i] is the last code of block i, mean[i] its mean ln finv */
    double *mean = malloc((size_t)n * sizeof *mean);
    int *end = malloc((size_t)n * sizeof *end);
    if (!mean || !end) {
        free(mean);
        free(end);
        return -2;
    }
    int blocks = 0;
    for (int z = 1; z <= n; z++) {
        mean[blocks] = log(f[z]);
        end[blocks++] = z;
        while (blocks > 1 && mean[blocks - 1] < mean[blocks - 2]) {
            int first = blocks > 2 ? end[blocks - 3] : 0;
            double w1 = end[blocks - 2] - first, w2 = end[blocks - 1] - end[blocks - 2];
            mean[blocks - 2] = (w1 * mean[blocks - 2] + w2 * mean[blocks - 1]) / (w1 + w2);
            end[blocks - 2] = end[blocks - 1];
            blocks--;
        }
    }
    for (int i = 0, z = 1; i < blocks; i++) {
        int length = end[i] - z + 1;
        for (; z <= end[i]; z++)
            if (length > 1) {
                f[z] = exp(mean[i]);
                changed++;
            }
    }
    free(mean);
    free(end);
    f[0] = 0;
    for (int z = 1; z <= n; z++) /* the darkest codes of a steep toe would leave the range of float */
        f[z] = fmax(f[z], f[n] * 1e-20);
    for (int z = 1; z <= n; z++)
        if (!(f[z] > f[z - 1] * (1 + 1e-9))) f[z] = f[z - 1] * (1 + 1e-9);
    return changed;
}

static double hat_mean_log(const response *r, int c)
{
    double sum = 0, weight = 0;
    int top = r->clip[0]; /* one for all channels, so that equal codes count alike */
    for (int k = 1; k < r->channels; k++) top = r->clip[k] < top ? r->clip[k] : top;
    for (int z = 1; z < top; z++) {
        double w = fmin(z, top - z);
        sum += w * log(r->finv[c][z]);
        weight += w;
    }
    return weight > 0 ? sum / weight : log(r->finv[c][top]);
}

int response_top(const response *r)
{
    int top = 0;
    for (int c = 0; c < r->channels; c++) top = r->clip[c] > top ? r->clip[c] : top;
    return top;
}

int response_normalise(response *r)
{
    static const double most = 1e6; /* between the channels' highest codes, and up from their means */
    double gauge[RESPONSE_MAX_CHANNELS], top = 0;
    for (int c = 0; c < r->channels; c++) {
        gauge[c] = hat_mean_log(r, c);
        top += (log(r->finv[c][r->clip[c]]) - gauge[c]) / r->channels;
    }
    for (int c = 0; c < r->channels; c++) {
        double scale = exp(-gauge[c] - top);
        for (int z = 0; z <= r->max_code; z++) r->finv[c][z] *= scale;
    }
    for (int c = 0; c < r->channels; c++)
        if (!(r->finv[c][r->clip[c]] > 1 / most && r->finv[c][r->clip[c]] < most)) return -1;
    return 0;
}

double response_edge(const response *r, int c, int z)
{
    const double *f = r->finv[c];
    if (z <= 1) { /* continue the power law of the first two codes down to z = 1/2 */
        double p = r->max_code > 1 ? log(f[2] / f[1]) / M_LN2 : 1;
        return f[1] * pow(0.5, fmin(fmax(p, 0.5), 5));
    }
    return 0.5 * (f[z - 1] + f[z]);
}

double response_slope(const response *r, int c, int z)
{
    const double *f = r->finv[c];
    int lo = z > 0 ? z - 1 : 0, hi = z < r->max_code ? z + 1 : r->max_code;
    return (f[hi] - f[lo]) / (hi - lo);
}

double response_forward(const response *r, int c, double e)
{
    const double *f = r->finv[c];
    int lo = 0, hi = r->max_code;
    if (!(e > 0)) return 0;
    if (e >= f[hi]) return hi;
    while (hi - lo > 1) {
        int mid = (lo + hi) / 2;
        if (f[mid] <= e) lo = mid;
        else hi = mid;
    }
    return lo + (e - f[lo]) / (f[hi] - f[lo]);
}

int response_recovered(response *r, response *got, const char *origin, errmsg *e)
{
    if (response_normalise(got)) {
        response_free(got);
        return err_set(e, "the recovered responses of the channels have nothing in common: times or order of "
                          "the images wrong?");
    }
    snprintf(got->origin, sizeof got->origin, "%s", origin);
    *r = *got;
    return 0;
}
