/*
 * feature.c - what a picture shows in a direction, as numbers that can be compared between pictures.
 */
#include "feature.h"

#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

/* A picture's colour at (x, y), bilinear, over the seam and the pole. */
static void bilinear(double rgb[3], const view *v, double x, double y)
{
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;

    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int k = 0; k < 4; k++) {
        int i = (int)fx + (k & 1), j = (int)fy + (k >> 1);
        const double w = (k & 1 ? a : 1 - a) * (k >> 1 ? b : 1 - b);
        if (j < 0) j = 0, i += v->nt / 2;
        if (j >= v->np) {
            j = v->np - 1;
            if (v->polar_max > .999 * pi) i += v->nt / 2;
        }
        i = ((i % v->nt) + v->nt) % v->nt;
        const float *p = v->rgb + 3 * ((size_t)j * (size_t)v->nt + (size_t)i);
        for (int c = 0; c < 3; c++) rgb[c] += w * (double)p[c];
    }
}

/* Direction of a place (p, q) of the octahedral map; both may lie somewhat beyond its square. */
static void octahedron(double d[3], double p, double q)
{
    if (fabs(p) > 1) p = copysign(2 - fabs(p), p), q = -q;
    if (fabs(q) > 1) q = copysign(2 - fabs(q), q), p = -p;
    d[0] = p, d[1] = q, d[2] = 1 - fabs(p) - fabs(q);
    if (d[2] < 0) d[0] = copysign(1 - fabs(q), p), d[1] = copysign(1 - fabs(p), q);
}

/* The mean over a node's cell, of sub x sub places. */
static int cell_mean(double rgb[3], const view *v, int i, int j, int sub)
{
    const double step = 2. / (v->nodes - 1);
    int n = 0;

    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int k = 0; k < sub * sub; k++) {
        double d[3], c[3];
        octahedron(d, -1 + step * (i + (k % sub + .5) / sub - .5), -1 + step * (j + (k / sub + .5) / sub - .5));
        const double r = hypot(d[0], d[1]), polar = atan2(r, d[2]);
        if (polar > v->polar_max + 1.5 * step) continue;
        bilinear(c, v, ((r > 0 ? atan2(d[1], d[0]) : 0) + pi) * v->nt / (2 * pi),
                 fmin(polar, v->polar_max) * v->np / v->polar_max);
        for (int m = 0; m < 3; m++) rgb[m] += c[m];
        n++;
    }
    for (int m = 0; m < 3 && n; m++) rgb[m] /= n;
    return n > 0;
}

static void logarithms(view *v, double dark)
{
    const double native = fmin(2 * pi / v->nt, v->polar_max / v->np), step = 2. / (v->nodes - 1);
    const int sub = (int)fmax(1, fmin(6, ceil(1.2 * step / native)));

#pragma omp parallel for schedule(static, 1)
    for (int j = 0; j < v->nodes; j++)
        for (int i = 0; i < v->nodes; i++) {
            float *f = v->feature + 4 * ((size_t)j * (size_t)v->nodes + (size_t)i);
            double rgb[3];
            const int seen = cell_mean(rgb, v, i, j, sub);
            for (int c = 0; c < 3; c++) f[c] = seen ? (float)log(fmax(0, rgb[c]) + dark) : FEATURE_NOTHING;
            f[3] = 0;
        }
}

/* Luminance about, from the logarithms of a node. */
static float grey(const float *f)
{
    return .265f * f[0] + .670f * f[1] + .065f * f[2];
}

/* A node less the mean of those up to three steps round it, of which none (a lamp) counts for much. */
static void stand_out(view *v)
{
    const int n = v->nodes, reach = 3;

#pragma omp parallel for schedule(static, 1)
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            float *f = v->feature + 4 * ((size_t)j * (size_t)n + (size_t)i), sum = 0;
            int many = 0;
            for (int b = j - reach; b <= j + reach && f[0] > FEATURE_NOTHING; b++)
                for (int a = i - reach; a <= i + reach; a++) {
                    if (a < 0 || b < 0 || a >= n || b >= n) continue;
                    const float *g = v->feature + 4 * ((size_t)b * (size_t)n + (size_t)a);
                    if (g[0] > FEATURE_NOTHING) sum += fmaxf(-.5f, fminf(.5f, grey(g) - grey(f))), many++;
                }
            if (many) f[3] = -sum / (float)many;
        }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* A small luminance beside those of most texels: below it nothing is told apart. */
static double darkness(const views *s, errmsg *e)
{
    enum { SOME = 20000 };
    float *l = malloc(SOME * sizeof *l);
    int n = 0;

    if (!l) {
        err_set(e, "no memory");
        return -1;
    }
    for (; n < SOME; n++) {
        const view *v = &s->v[n % s->n];
        const size_t at = (size_t)n * 2654435761u % ((size_t)v->nt * (size_t)v->np);
        l[n] = (float)ilf_luminance(v->rgb + 3 * at);
    }
    qsort(l, SOME, sizeof *l, compare_floats);
    const double dark = fmax(1e-12, .1 * (double)l[SOME / 2]);
    free(l);
    return dark;
}

int feature_make(views *s, double texel, errmsg *e)
{
    const double dark = darkness(s, e);

    if (dark < 0) return -1;
    for (int k = 0; k < s->n; k++) {
        view *v = &s->v[k];
        const double native = fmax(2 * pi / v->nt, v->polar_max / v->np);
        v->nodes = (int)fmin(1024, fmax(48, 4 / fmax(native, texel))) | 1;
        v->feature = malloc((size_t)v->nodes * (size_t)v->nodes * 4 * sizeof *v->feature);
        if (!v->feature) return err_set(e, "no memory for %s's features", v->name);
        logarithms(v, dark);
        stand_out(v);
    }
    return 0;
}
