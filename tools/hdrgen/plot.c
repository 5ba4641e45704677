/*
 * plot.c - see plot.h.
 */
#include "plot.h"

#include <math.h>
#include <stdlib.h>

#include "base/svgplot.h"

enum { MOST_POINTS = 1500, STOPS = 16, CURVE = 256 };

static const char *const inks[3] = {"#c0392b", "#27803b", "#2d5fb3"};

/* The points of pixel i of the samples: 0, or a number of them in at. */
static int points_of(double (*at)[2], const job *j, int ch, int i)
{
    const samples *s = &j->samples;
    const uint16_t *z = s->z[ch] + (size_t)i * (size_t)s->exposures;
    double num = 0, den = 0;
    for (int k = 0; k < s->exposures; k++) { /* X by hat weights: good enough to look at */
        double w = z[k] > 0 && z[k] < s->max_code ? fmin(z[k], s->max_code - z[k]) : 0;
        num += w * log2(fmax(j->response.finv[ch][z[k]], 1e-30) / j->exposure[k]);
        den += w;
    }
    int n = 0;
    for (int k = 0; den > 0 && k < s->exposures; k++) {
        if (z[k] == 0 || z[k] >= s->max_code) continue; /* says less than or more than, not how much */
        at[n][0] = z[k], at[n][1] = num / den + log2(j->exposure[k]);
        n++;
    }
    return n;
}

static int draw_points(svgplot *p, const job *j, int ch)
{
    const samples *s = &j->samples;
    const int stride = s->n[ch] / MOST_POINTS + 1, most = (s->n[ch] + stride - 1) / stride;
    double(*at)[2] = malloc(((size_t)most * (size_t)s->exposures + 1) * sizeof *at);
    int n = 0;
    if (!at) return -1;
    for (int i = 0; i < s->n[ch]; i += stride) n += points_of(at + n, j, ch, i);
    svgplot_dots(p, inks[ch], (const double(*)[2])at, n, SVGPLOT_SMALL);
    free(at);
    return 0;
}

static void draw_curve(svgplot *p, const response *r, int ch)
{
    double at[CURVE + 1][2];
    for (int k = 0; k <= CURVE; k++) {
        double z = (double)k * r->max_code / CURVE;
        int below = (int)z < r->max_code ? (int)z : r->max_code - 1;
        double e = r->finv[ch][below] + (z - below) * (r->finv[ch][below + 1] - r->finv[ch][below]);
        at[k][0] = z, at[k][1] = e > 0 ? log2(e) : NAN;
    }
    svgplot_line(p, inks[ch], (const double(*)[2])at, CURVE + 1);
}

int plot_response(const job *j, const char *path, errmsg *e)
{
    const response *r = &j->response;
    double top = -INFINITY, step = 1;
    svgplot *p;
    int bad = 0;
    for (int ch = 0; ch < r->channels; ch++) top = fmax(top, ceil(log2(r->finv[ch][r->max_code]) + 0.5));
    while (8 * step < r->max_code) step *= 2;
    const svgplot_axis x = {0, r->max_code, step, "code number"},
                       y = {top - STOPS, top, 2, "log2 of exposure (1: highest code)"};
    if (svgplot_begin(&p, path, &x, &y, "camera response and the pixels that it was found from", e))
        return -1;
    for (int ch = 0; ch < r->channels; ch++) bad |= draw_points(p, j, ch);
    for (int ch = 0; ch < r->channels; ch++) draw_curve(p, r, ch);
    if (svgplot_end(p, e)) return -1;
    return bad ? err_set(e, "%s: out of memory", path) : 0;
}
