/*
 * holes.c - see holes.h.  Filling is by a pyramid: levels of half the size hold sums of solid angle and of
 * solid angle times value of what is seen; a hole takes the bilinear value of the finest level that knows its
 * surroundings (Gortler et al., The Lumigraph, 1996, "pull-push").
 */
#include "holes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double all_round = 0.9; /* of the columns: a rim may be a little off the probe's pole */

static int is_seen(float share)
{
    return share > 0; /* false for NaN */
}

/* Solid angle of a texel of row y, up to a factor. */
static double row_weight(int y, int h, double polar_max)
{
    return cos(y * polar_max / h) - cos((y + 1) * polar_max / h);
}

/* The first row of column x that lies beyond the rim: it may wave by two rows above the last one. */
static int rim_of(const float *seen, int w, int h, int rows, int x)
{
    int y = rows;
    while (rows < h && y > rows - 2 && y > 1 && !is_seen(seen[(size_t)(y - 1) * (size_t)w + (size_t)x])) y--;
    return y;
}

holes holes_find(const float *seen, int w, int h, double polar_max, int rim)
{
    holes f = {0};
    double all = 1 - cos(polar_max);
    int any = 0;
    for (int y = 0; y < h; y++) {
        double sum = 0;
        int columns = 0;
        for (int x = 0; x < w; x++) {
            float share = seen[(size_t)y * (size_t)w + (size_t)x];
            if (!is_seen(share)) continue;
            sum += share < 1 ? (double)share : 1;
            columns++;
        }
        any |= columns > 0;
        if (columns >= all_round * w) f.rows = y + 1, f.edge = (y + sum / w) * polar_max / h;
    }
    if (!rim || f.rows == 0) f.rows = any ? h : 0;
    if (f.rows == h) f.edge = polar_max;
    for (int x = 0; x < w; x++)
        for (int y = 0; y < rim_of(seen, w, h, f.rows, x); y++)
            if (!is_seen(seen[(size_t)y * (size_t)w + (size_t)x]))
                f.among += row_weight(y, h, polar_max) / all / w;
    return f;
}

void holes_hold(float *rgb, const float *seen, int w, int h, int rows)
{
    for (int x = 0; x < w; x++)
        for (int y = rim_of(seen, w, h, rows, x); y < h; y++) {
            size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (!is_seen(seen[at])) memcpy(rgb + 3 * at, rgb + 3 * (at - (size_t)w), 3 * sizeof *rgb);
        }
}

/* ---- filling ---------------------------------------------------------------------------------------- */

typedef struct level {
    int w, h;
    double *sum; /* 4 a texel: solid angle seen, and that times R, G, B */
} level;

enum { LEVELS = 32 };

static void halve(level *to, const level *from)
{
    for (int y = 0; y < from->h; y++)
        for (int x = 0; x < from->w; x++)
            for (int c = 0; c < 4; c++)
                to->sum[4 * ((size_t)(y / 2) * (size_t)to->w + (size_t)(x / 2)) + (size_t)c] +=
                    from->sum[4 * ((size_t)y * (size_t)from->w + (size_t)x) + (size_t)c];
}

/* Bilinear between texel centres of the coarser level; azimuth wraps. */
static void sample(double rgb[3], const level *l, double u, double v)
{
    double fx = u * l->w - 0.5, fy = v * l->h - 0.5, all = 0;
    int x0 = (int)floor(fx), y0 = (int)floor(fy);
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int k = 0; k < 4; k++) {
        int x = (x0 + (k & 1) + l->w) % l->w, y = y0 + (k >> 1);
        double weight = ((k & 1) ? fx - x0 : 1 - (fx - x0)) * ((k >> 1) ? fy - y0 : 1 - (fy - y0));
        y = y < 0 ? 0 : y >= l->h ? l->h - 1 : y;
        const double *p = l->sum + 4 * ((size_t)y * (size_t)l->w + (size_t)x);
        for (int c = 0; c < 3; c++) rgb[c] += weight * p[1 + c] / p[0];
        all += weight;
    }
    for (int c = 0; c < 3; c++) rgb[c] /= all;
}

/* Texels of l without anything seen take what the coarser level says. */
static void complete(level *l, const level *coarser)
{
    for (int y = 0; y < l->h; y++)
        for (int x = 0; x < l->w; x++) {
            double *p = l->sum + 4 * ((size_t)y * (size_t)l->w + (size_t)x);
            if (p[0] > 0) continue;
            sample(p + 1, coarser, (x + 0.5) / l->w, (y + 0.5) / l->h);
            p[0] = 1;
        }
}

int holes_fill(float *rgb, const float *seen, int w, int h, double polar_max)
{
    level l[LEVELS] = {{w, h, NULL}};
    int n = 1, rc = 0;
    while (l[n - 1].w > 1 || l[n - 1].h > 1)
        l[n] = (level){(l[n - 1].w + 1) / 2, (l[n - 1].h + 1) / 2, NULL}, n++;
    for (int k = 0; k < n; k++)
        if (!(l[k].sum = calloc((size_t)l[k].w * (size_t)l[k].h, 4 * sizeof(double)))) rc = -1;
    for (size_t i = 0; rc == 0 && i < (size_t)w * (size_t)h; i++) {
        if (!is_seen(seen[i])) continue;
        double weight = row_weight((int)(i / (size_t)w), h, polar_max);
        l[0].sum[4 * i] = weight;
        for (size_t c = 0; c < 3; c++) l[0].sum[4 * i + 1 + c] = weight * (double)rgb[3 * i + c];
    }
    for (int k = 1; rc == 0 && k < n; k++) halve(&l[k], &l[k - 1]);
    if (rc == 0 && l[n - 1].sum[0] > 0) {
        for (int k = n - 2; k >= 0; k--) complete(&l[k], &l[k + 1]);
        for (size_t i = 0; i < (size_t)w * (size_t)h; i++)
            for (size_t c = 0; c < 3 && !is_seen(seen[i]); c++)
                rgb[3 * i + c] = (float)l[0].sum[4 * i + 1 + c];
    }
    for (int k = 0; k < n; k++) free(l[k].sum);
    return rc;
}
