/*
 * reduce.c - pictures made smaller, light kept.
 */
#include "reduce.h"

#include <math.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

/* Where a cell of the smaller map begins, in cells of the larger. */
static double edge(int k, int few, int many)
{
    return (double)k * many / few;
}

/* What a row holds between two places (in rows): solid angle but for a factor. */
static double weight_of_rows(double lo, double hi, double step)
{
    return cos(lo * step) - cos(hi * step);
}

static void add_row(double sum[3], double *weight, const float *row, double from, double to, double w)
{
    for (int x = (int)from; x < to; x++) {
        const double part = w * (fmin(to, x + 1) - fmax(from, x));
        for (int c = 0; c < 3; c++) sum[c] += part * (double)row[3 * x + c];
        *weight += part;
    }
}

static void one_texel(float *to, const double x[2], const double y[2], const float *from, int NT, double step)
{
    double sum[3] = {0, 0, 0}, weight = 0;

    for (int r = (int)y[0]; r < y[1]; r++)
        add_row(sum, &weight, from + (size_t)r * (size_t)NT * 3, x[0], x[1],
                weight_of_rows(fmax(y[0], r), fmin(y[1], r + 1), step));
    for (int c = 0; c < 3; c++) to[c] = (float)(sum[c] / weight);
}

void reduce_probe(float *to, int nt, int np, const float *from, int NT, int NP, double polar_max)
{
    const double step = fmin(polar_max, pi) / NP;

    if (nt == NT && np == NP) {
        memcpy(to, from, (size_t)nt * (size_t)np * 3 * sizeof *to);
        return;
    }
    for (int y = 0; y < np; y++)
        for (int x = 0; x < nt; x++, to += 3)
            one_texel(to, (double[]){edge(x, nt, NT), fmin(NT, edge(x + 1, nt, NT))},
                      (double[]){edge(y, np, NP), fmin(NP, edge(y + 1, np, NP))}, from, NT, step);
}

static int fewer(int n, double factor)
{
    const int m = (int)(n / factor);

    return m > 2 ? m : n < 2 ? n : 2;
}

void reduce_size(int size[2], const ilf_mask *mask, double factor)
{
    size[0] = factor > 1 ? fewer(mask->nx, factor) : mask->nx;
    size[1] = factor > 1 ? fewer(mask->ny, factor) : mask->ny;
}

/* The place of sample k of n among m, and how far it is to the next one. */
static int placed(double *part, int k, int n, int m)
{
    const double at = n > 1 ? (double)k * (m - 1) / (n - 1) : 0;
    const int i = at < m - 1 ? (int)at : m > 1 ? m - 2 : 0;

    *part = at - i;
    return i;
}

void reduce_picture(float *to, const int size[2], const ilf_mask *m)
{
    const int right = m->nx > 1, up = m->ny > 1 ? m->nx : 0;

    for (int k = 0; k < (m->nz > 1 ? m->nz : 1); k++)
        for (int y = 0; y < size[1]; y++)
            for (int x = 0; x < size[0]; x++) {
                double a, b;
                const int i = placed(&a, x, size[0], m->nx), j = placed(&b, y, size[1], m->ny);
                const float *g = m->grid + ((size_t)k * (size_t)m->ny + (size_t)j) * (size_t)m->nx + i;
                *to++ = (float)((1 - b) * ((1 - a) * (double)g[0] + a * (double)g[right]) +
                                b * ((1 - a) * (double)g[up] + a * (double)g[up + right]));
            }
}
