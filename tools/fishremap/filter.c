/*
 * filter.c - Gaussian means over finer texels (filter.h): along the rows, then along the columns.
 */
#include "filter.h"

#include <math.h>
#include <stdlib.h>

#include "image/image.h"

/* Sums over a part of a row of finer texels: radiance (3), what is seen of the solid angle, and all of it;
 * all by weight. */
enum { SEEN = 3, ALL = 4, SUMS = 5 };

typedef struct kernel {
    double *g; /* weight of finer texel times*X + k - reach for output texel X */
    int n, reach;
} kernel;

static int kernel_make(kernel *q, double sd, int times)
{
    const double own = 1. / (12. * times * times),
                 narrow = sqrt(sd * sd - own); /* variance of a finer texel's own width */
    q->reach = (int)ceil(4 * sd * times);
    q->n = times + 2 * q->reach;
    q->g = malloc(sizeof *q->g * (size_t)q->n);
    if (!q->g) return -1;
    for (int k = 0; k < q->n; k++) {
        const double d = (k - q->reach + 0.5) / times - 0.5;
        q->g[k] = exp(-0.5 * d * d / (narrow * narrow));
    }
    return 0;
}

/* The chart of finer texels; returns how many times as many a side, or 0: more of them than a picture may
 * have. */
static int finer(chart *fine, const chart *out, double sd, errmsg *e)
{
    const int k = (int)fmax(ceil(2 / sd), 1);
    const double w = (double)out->width * k, h = (double)out->height * k;
    if (w > IMG_MAX_SIDE || h > IMG_MAX_SIDE || w * h > (double)IMG_MAX_PIXELS) {
        err_set(e,
                "--filter gaussian:%g: expected an output of which a picture of %d times finer texels can be "
                "made, found %d x %d",
                sd, k, out->width, out->height);
        return 0;
    }
    *fine = *out;
    fine->width *= k, fine->height *= k;
    fine->cx *= k, fine->cy *= k, fine->radius *= k;
    return k;
}

static int whole_turn(const chart *c)
{
    return c->kind == CHART_GRID && c->lon_span > 2 * M_PI * (1 - 1e-12);
}

/* One row of finer texels, summed for each column of the output.  angle: room for the row's solid angles. */
static void along_row(float *sums, double *angle, const kernel *q, const chart *out, const float *rgb,
                      const float *alpha, const chart *fine, int times, int y)
{
    const int w = fine->width, wrap = whole_turn(fine);
    for (int x = 0; x < w; x++)
        angle[x] = x && fine->kind == CHART_GRID ? angle[0] : chart_pixel_solid_angle(fine, x, y);
    for (int X = 0; X < out->width; X++) {
        double s[SUMS] = {0};
        for (int k = 0; k < q->n; k++) {
            int x = X * times + k - q->reach;
            if (wrap) x = (x % w + w) % w;
            else if (x < 0 || x >= w) continue;
            const double all = q->g[k] * angle[x], seen = all * (double)alpha[x];
            for (int c = 0; c < 3; c++) s[c] += seen * (double)rgb[3 * x + c];
            s[SEEN] += seen;
            s[ALL] += all;
        }
        for (int c = 0; c < SUMS; c++) sums[SUMS * X + c] = (float)s[c];
    }
}

/* Add row y of sums at column X, times g; beyond a pole the row there that is as far, half a turn away. */
static void add_row(double s[SUMS], const float *sums, const chart *out, const chart *fine, int X, int y,
                    double g)
{
    const int h = fine->height, w = out->width, over_top = y < 0, over_bottom = y >= h;
    int x[2] = {X, X};
    if (over_top || over_bottom) {
        if (!whole_turn(fine) || (over_top && fine->polar_min > 1e-6) ||
            (over_bottom && fine->polar_max < M_PI * (1 - 1e-6)))
            return;
        y = over_top ? -1 - y : 2 * h - 1 - y;
        if (y < 0 || y >= h) return;
        x[0] = (X + w / 2) % w,
        x[1] = (X + (w + 1) / 2) % w; /* of an odd number of columns two are as near */
    }
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < SUMS; c++)
            s[c] += 0.5 * g * (double)sums[((size_t)y * (size_t)w + (size_t)x[k]) * SUMS + (size_t)c];
}

static int gaussian(float *rgb, float *alpha, const chart *out, double sd, const float *fine_rgb,
                    const float *fine_alpha, const chart *fine, int times, errmsg *e)
{
    kernel q;
    const size_t w = (size_t)out->width, fine_w = (size_t)fine->width;
    float *sums = malloc(sizeof *sums * SUMS * w * (size_t)fine->height);
    if (!sums || kernel_make(&q, sd, times)) {
        free(sums);
        return err_set(e, "out of memory");
    }
    int failed = 0;
#pragma omp parallel reduction(| : failed)
    {
        double *angle = malloc(sizeof *angle * fine_w);
        failed |= !angle;
#pragma omp for schedule(static)
        for (int y = 0; y < fine->height; y++) {
            const size_t row = (size_t)y * fine_w;
            if (angle)
                along_row(sums + (size_t)y * w * SUMS, angle, &q, out, fine_rgb + 3 * row, fine_alpha + row,
                          fine, times, y);
        }
        free(angle);
    }
#pragma omp parallel for schedule(static) if (!failed)
    for (int Y = 0; Y < out->height; Y++)
        for (int X = 0; X < out->width; X++) {
            double s[SUMS] = {0};
            const size_t at = (size_t)Y * w + (size_t)X;
            for (int k = 0; k < q.n; k++) add_row(s, sums, out, fine, X, Y * times + k - q.reach, q.g[k]);
            for (size_t c = 0; c < 3; c++) rgb[3 * at + c] = s[SEEN] > 0 ? (float)(s[c] / s[SEEN]) : 0;
            const double share = s[ALL] > 0 ? s[SEEN] / s[ALL] : 0;
            alpha[at] = (float)(share > 0.998 ? 1 : share);
        }
    free(sums);
    free(q.g);
    return failed ? err_set(e, "out of memory") : 0;
}

int filter_texels(float *rgb, float *alpha, const chart *out, double sd, filter_areas *areas, void *arg,
                  errmsg *e)
{
    chart fine;
    if (!(sd > 0)) return areas(rgb, alpha, out, arg, e);
    const int times = finer(&fine, out, sd, e);
    if (times < 1) return -1;
    const size_t n = (size_t)fine.width * (size_t)fine.height;
    float *fine_rgb = malloc(n * 3 * sizeof *fine_rgb), *fine_alpha = malloc(n * sizeof *fine_alpha);
    int rc =
        fine_rgb && fine_alpha ? areas(fine_rgb, fine_alpha, &fine, arg, e) : err_set(e, "out of memory");
    if (!rc) rc = gaussian(rgb, alpha, out, sd, fine_rgb, fine_alpha, &fine, times, e);
    free(fine_rgb);
    free(fine_alpha);
    return rc;
}
