/*
 * plot.c - see plot.h.
 */
#include "plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 900, HEIGHT = 700, MARGIN = 30, MOST_POINTS = 1500 };

typedef struct canvas {
    img im;
    double lo, hi, max_code; /* log2 exposure at the lower and upper edge */
} canvas;

static void mix(canvas *c, double px, double py, const float ink[3], float strength)
{
    int x = (int)floor(px), y = (int)floor(py);
    if (x < MARGIN || x >= WIDTH - MARGIN || y < MARGIN || y >= HEIGHT - MARGIN) return;
    float *p = c->im.pix + ((size_t)y * WIDTH + (size_t)x) * 3;
    for (int k = 0; k < 3; k++) p[k] += strength * (ink[k] - p[k]);
}

static double x_of(const canvas *c, double z)
{
    return MARGIN + z / c->max_code * (WIDTH - 2 * MARGIN - 1);
}

static double y_of(const canvas *c, double log2e)
{
    return HEIGHT - MARGIN - 1 - (log2e - c->lo) / (c->hi - c->lo) * (HEIGHT - 2 * MARGIN - 1);
}

static void points(canvas *c, const job *j, int ch, const float ink[3])
{
    const samples *s = &j->samples;
    int stride = s->n[ch] / MOST_POINTS + 1;
    for (int i = 0; i < s->n[ch]; i += stride) {
        const uint16_t *z = s->z[ch] + (size_t)i * (size_t)s->exposures;
        double num = 0, den = 0;
        for (int k = 0; k < s->exposures; k++) { /* X by hat weights: good enough to look at */
            double w = z[k] > 0 && z[k] < s->max_code ? fmin(z[k], s->max_code - z[k]) : 0;
            num += w * log2(fmax(j->response.finv[ch][z[k]], 1e-30) / j->exposure[k]);
            den += w;
        }
        for (int k = 0; den > 0 && k < s->exposures; k++) {
            double y = y_of(c, num / den + log2(j->exposure[k])), x = x_of(c, z[k] + 0.5);
            for (int d = 0; d < 4; d++) mix(c, x + (d & 1), y + (d >> 1), ink, 0.35f);
        }
    }
}

static void curve(canvas *c, const response *r, int ch, const float ink[3])
{
    double last = NAN;
    for (int x = 0; x < WIDTH - 2 * MARGIN; x++) {
        double z = x * c->max_code / (WIDTH - 2 * MARGIN - 1.0);
        int at = (int)z < r->max_code ? (int)z : r->max_code - 1;
        double e = r->finv[ch][at] + (z - at) * (r->finv[ch][at + 1] - r->finv[ch][at]);
        double y = e > 0 ? y_of(c, log2(e)) : NAN;
        if (isfinite(y) && isfinite(last))
            for (double t = fmin(y, last); t <= fmax(y, last) + 1; t++) mix(c, MARGIN + x, t, ink, 1);
        last = y;
    }
}

int plot_response(const job *j, const char *path, errmsg *e)
{
    static const float inks[3][3] = {{200, 30, 30}, {20, 140, 40}, {40, 60, 220}}, grid[3] = {215, 215, 215};
    canvas c = {.max_code = j->response.max_code, .hi = -INFINITY};
    if (img_alloc(&c.im, WIDTH, HEIGHT, 3, e)) return -1;
    c.im.info.coded = 1;
    c.im.info.max_code = 255;
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * 3; i++) c.im.pix[i] = 255;
    for (int ch = 0; ch < j->response.channels; ch++)
        c.hi = fmax(c.hi, ceil(log2(j->response.finv[ch][j->response.max_code]) + 0.5));
    c.lo = c.hi - 16;
    for (int stop = 0; stop <= 16; stop++)
        for (int x = MARGIN; x < WIDTH - MARGIN; x++) mix(&c, x, y_of(&c, c.lo + stop), grid, 1);
    for (int part = 0; part <= 8; part++)
        for (int y = MARGIN; y < HEIGHT - MARGIN; y++) mix(&c, x_of(&c, c.max_code * part / 8), y, grid, 1);
    for (int ch = 0; ch < j->response.channels; ch++) points(&c, j, ch, inks[ch]);
    for (int ch = 0; ch < j->response.channels; ch++) curve(&c, &j->response, ch, inks[ch]);
    int bad = img_write(&c.im, path, NULL, e);
    img_free(&c.im);
    return bad;
}
