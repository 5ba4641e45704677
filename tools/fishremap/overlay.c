/*
 * overlay.c - circles drawn on a picture (overlay.h).
 */
#include "overlay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Value that shall be white: the 99th percentile of the brightest channel. */
static float white_of(const img *im)
{
    size_t n = (size_t)im->info.width * (size_t)im->info.height, step = n / 50000 + 1, k = 0;
    float *some = malloc((n / step + 1) * sizeof *some), w = 1;
    if (!some) return w;
    for (size_t i = 0; i < n; i += step) {
        const float *p = im->pix + 4 * i;
        float v = fmaxf(fmaxf(p[0], p[1]), p[2]);
        if (v - v == 0) some[k++] = v;
    }
    qsort(some, k, sizeof *some, by_value);
    if (k && some[k * 99 / 100] > 0) w = some[k * 99 / 100];
    free(some);
    return w;
}

static void dot(img *im, double x, double y, const float colour[3])
{
    int i = (int)floor(x), j = (int)floor(y);
    if (i < 0 || j < 0 || i >= im->info.width || j >= im->info.height) return;
    memcpy(im->pix + 3 * ((size_t)j * (size_t)im->info.width + (size_t)i), colour, 3 * sizeof(float));
}

int overlay_write(const char *path, const img *im, const sphere_seen *q, int n, errmsg *e)
{
    img out;
    if (img_alloc(&out, im->info.width, im->info.height, 3, e)) return -1;
    size_t total = (size_t)im->info.width * (size_t)im->info.height;
    float white = white_of(im);
    for (size_t i = 0; i < total; i++)
        for (size_t c = 0; c < 3; c++) {
            float v = 0.6f * im->pix[4 * i + c] / white;
            out.pix[3 * i + c] = v > 0 ? fminf(v, 0.6f) : 0;
        }
    for (int k = 0; k < n; k++) {
        float s = n > 1 ? (float)k / (float)(n - 1) : 0;
        float colour[3] = {1 - s, s < 0.5f ? 2 * s : 2 - 2 * s, s};
        double diag = hypot(im->info.width, im->info.height);
        int steps = (int)fmin(8 * fmin(q[k].r, diag) + 16, 100000);
        for (int i = 0; i < steps; i++) {
            double a = 2 * M_PI * i / steps;
            dot(&out, q[k].x + q[k].r * cos(a), q[k].y + q[k].r * sin(a), colour);
        }
        for (int i = -4; i <= 4; i++) {
            dot(&out, q[k].x + i, q[k].y, colour);
            dot(&out, q[k].x, q[k].y + i, colour);
        }
    }
    int rc = img_write(&out, path, NULL, e);
    img_free(&out);
    return rc;
}
