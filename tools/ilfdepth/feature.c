/*
 * feature.c - what a picture shows in a direction, as numbers that can be compared between pictures.
 */
#include "feature.h"

#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

/* The texel (i, j), over the seam and the poles. */
static const float *texel_at(const view *v, int i, int j)
{
    if (j < 0) j = -1 - j, i += v->nt / 2;
    if (j >= v->np && v->polar_max > .999 * pi) j = 2 * v->np - 1 - j, i += v->nt / 2;
    j = j < 0 ? 0 : j >= v->np ? v->np - 1 : j;
    i = ((i % v->nt) + v->nt) % v->nt;
    return v->rgb + 3 * ((size_t)j * (size_t)v->nt + (size_t)i);
}

/* Catmull and Rom's weights: they blur less than linear ones, whose blur differs from picture to picture. */
static void cubic_weights(double w[4], double a)
{
    w[0] = a * (-.5 + a * (1 - .5 * a)), w[1] = 1 + a * a * (-2.5 + 1.5 * a);
    w[2] = a * (.5 + a * (2 - 1.5 * a)), w[3] = a * a * (-.5 + .5 * a);
}

/* A picture's colour at (x, y), cubic, but hardly more or less than the four texels round it. */
static void colour(double rgb[3], const view *v, double x, double y)
{
    const double fx = floor(x - .5), fy = floor(y - .5);
    double wx[4], wy[4], lo[3] = {1e300, 1e300, 1e300}, hi[3] = {-1e300, -1e300, -1e300};

    cubic_weights(wx, x - .5 - fx), cubic_weights(wy, y - .5 - fy);
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int k = 0; k < 16; k++) {
        const int a = k % 4, b = k / 4, near = (a == 1 || a == 2) && (b == 1 || b == 2);
        const float *p = texel_at(v, (int)fx + a - 1, (int)fy + b - 1);
        for (int c = 0; c < 3; c++) {
            rgb[c] += wx[a] * wy[b] * (double)p[c];
            if (near) lo[c] = fmin(lo[c], (double)p[c]), hi[c] = fmax(hi[c], (double)p[c]);
        }
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = fmax(lo[c] - .1 * (hi[c] - lo[c]), fmin(hi[c] + .1 * (hi[c] - lo[c]), rgb[c]));
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
        octahedron(d, -1 + step * (i + (k % sub + .5) / sub - .5),
                   -1 + step * (j + (k / sub + .5) / sub - .5));
        const double r = hypot(d[0], d[1]), polar = atan2(r, d[2]);
        if (polar > v->polar_max + 1.5 * step) continue;
        colour(c, v, ((r > 0 ? atan2(d[1], d[0]) : 0) + pi) * v->nt / (2 * pi),
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
static void stand_out(view *v, float weight)
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
            if (many) f[3] = -weight * sum / (float)many;
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
        v->nodes = (int)fmin(1024, fmax(48, 6 / fmax(native, texel))) | 1;
        v->feature = malloc((size_t)v->nodes * (size_t)v->nodes * 4 * sizeof *v->feature);
        if (!v->feature) return err_set(e, "no memory for %s's features", v->name);
        logarithms(v, dark);
        stand_out(v, s->n > 4 ? .1f : .3f); /* it blurs edges, where many pictures tell more without it */
    }
    return 0;
}
