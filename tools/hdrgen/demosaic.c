/*
 * demosaic.c - see demosaic.h.
 *
 * Bayer: Malvar, He and Cutler, High-quality linear interpolation for demosaicing of Bayer-patterned color
 * images, ICASSP 2004, fig. 2: the bilinear value plus a share of the local curvature of the colour that is
 * there,
 *
 *   green at red/blue    bilinear + 1/2 (own - mean of the 4 of its colour at distance 2)
 *   red/blue at green    bilinear + 5/8 (own - ...)
 *   red/blue opposite    bilinear + 3/4 (own - mean of the 4 of its colour at distance 2)
 *
 * held between the photosites that the bilinear value is made of.  Other patterns (X-Trans): green by the
 * mean of its neighbours weighted 1/d^2, the others by that mean of their differences from green, held
 * likewise.
 */
#include "demosaic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The share counts less where the own colour curves much, not at all from a fifth of its mean on: beside
 * lamps the held value would add or lose light (up to 5 % of a lamp a few pixels wide), the bilinear one does
 * neither. */
static const float lamp = 5;

typedef struct plane {
    const float *p, *s; /* values, standard deviations or NULL */
    int w, h;
} plane;

typedef struct term {
    signed char x, y;
    float weight;
} term;

/* The first four (two) are the bilinear part, which limits. */
typedef struct kernel {
    int limits, n;
    term t[11];
} kernel;

static const kernel green = {4,
                             9,
                             {{-1, 0, .25f},
                              {1, 0, .25f},
                              {0, -1, .25f},
                              {0, 1, .25f},
                              {0, 0, .5f},
                              {-2, 0, -.125f},
                              {2, 0, -.125f},
                              {0, -2, -.125f},
                              {0, 2, -.125f}}};
static const kernel across = {2,
                              11,
                              {{-1, 0, .5f},
                               {1, 0, .5f},
                               {0, 0, .625f},
                               {-1, -1, -.125f},
                               {1, -1, -.125f},
                               {-1, 1, -.125f},
                               {1, 1, -.125f},
                               {-2, 0, -.125f},
                               {2, 0, -.125f},
                               {0, -2, .0625f},
                               {0, 2, .0625f}}};
static const kernel along = {2,
                             11,
                             {{0, -1, .5f},
                              {0, 1, .5f},
                              {0, 0, .625f},
                              {-1, -1, -.125f},
                              {1, -1, -.125f},
                              {-1, 1, -.125f},
                              {1, 1, -.125f},
                              {0, -2, -.125f},
                              {0, 2, -.125f},
                              {-2, 0, .0625f},
                              {2, 0, .0625f}}};
static const kernel opposite = {4,
                                9,
                                {{-1, -1, .25f},
                                 {1, -1, .25f},
                                 {-1, 1, .25f},
                                 {1, 1, .25f},
                                 {0, 0, .75f},
                                 {-2, 0, -.1875f},
                                 {2, 0, -.1875f},
                                 {0, -2, -.1875f},
                                 {0, 2, -.1875f}}};

static inline int mirror(int i, int n)
{
    if (n == 1) return 0;
    i = i < 0 ? -i : i;
    return i >= n ? 2 * (n - 1) - i : i;
}

static inline size_t place(const plane *m, int x, int y)
{
    return (size_t)mirror(y, m->h) * (size_t)m->w + (size_t)mirror(x, m->w);
}

/* The curvature is that of another colour: where that is the stronger one (a coloured lamp), it counts by the
 * ratio. */
static void apply(float *v, float *sd, const kernel *k, const plane *m, int x, int y)
{
    float straight = 0, curve = 0, lo = INFINITY, hi = 0, own = 0, far = 0, near = 0, away = 0, var = 0,
          var_curve = 0;
    for (int i = 0; i < k->n; i++) {
        const term *t = &k->t[i];
        size_t at = place(m, x + t->x, y + t->y);
        float p = m->p[at], s = m->s ? t->weight * m->s[at] : 0;
        if (i < k->limits) {
            straight += t->weight * p;
            var += s * s;
            lo = fminf(lo, p);
            hi = fmaxf(hi, p);
        } else {
            curve += t->weight * p;
            var_curve += s * s;
            if (t->weight > 0) {
                own += t->weight * p;
                near += t->weight;
            } else {
                far -= t->weight * p;
                away -= t->weight;
            }
        }
    }
    own /= near;
    far /= away;
    float other = 0.5f * (own + far), ratio = other > straight ? straight / other : 1;
    float fade = 1 - lamp * fabsf(own - far) / (own + far + 1e-30f);
    ratio *= fade > 0 ? fade : 0;
    float sum = straight + ratio * curve;
    int held = sum < lo || sum > hi;
    *v = sum < lo ? lo : sum > hi ? hi : sum;
    if (m->s) *sd = sqrtf(held ? var : var + ratio * ratio * var_curve);
}

static void bayer_row(float *rgb, float *rgb_sigma, const plane *m, const cfa *f, int y)
{
    for (int x = 0; x < m->w; x++) {
        size_t at = (size_t)y * (size_t)m->w + (size_t)x;
        int own = cfa_at(f, x, y), beside = cfa_at(f, x + 1, y);
        for (int c = 0; c < 3; c++) {
            float *v = rgb + 3 * at + c, *sd = rgb_sigma ? rgb_sigma + 3 * at + c : NULL;
            if (c == own) {
                *v = m->p[at];
                if (sd) *sd = m->s[at];
                continue;
            }
            apply(v, sd, c == 1 ? &green : own != 1 ? &opposite : beside == c ? &across : &along, m, x, y);
        }
    }
}

/* ---- any other pattern
 * --------------------------------------------------------------------------------------- */

enum { REACH = 2 };

/* Colour c at (x, y) from its photosites within REACH; base: green, which the difference is taken from, or
 * NULL. */
static void around(float *v, float *sd, const plane *m, const cfa *f, const float *base, int c, int x, int y)
{
    float sum = 0, var = 0, weight = 0, lo = INFINITY, hi = 0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++) {
            int xx = x + dx, yy = y + dy;
            if (xx < 0 || yy < 0 || xx >= m->w || yy >= m->h || cfa_at(f, xx, yy) != c) continue;
            size_t at = (size_t)yy * (size_t)m->w + (size_t)xx;
            float w = 1 / (float)(dx * dx + dy * dy);
            sum += w * (m->p[at] - (base ? base[3 * at + 1] : 0));
            var += m->s ? w * w * m->s[at] * m->s[at] : 0;
            weight += w;
            lo = fminf(lo, m->p[at]);
            hi = fmaxf(hi, m->p[at]);
        }
    if (!(weight > 0)) { /* a corner without that colour */
        *v = m->p[(size_t)y * (size_t)m->w + (size_t)x];
        lo = hi = *v;
    } else {
        *v = sum / weight + (base ? base[3 * ((size_t)y * (size_t)m->w + (size_t)x) + 1] : 0);
    }
    *v = *v < lo ? lo : *v > hi ? hi : *v;
    if (sd) *sd = weight > 0 ? sqrtf(var) / weight : m->s[(size_t)y * (size_t)m->w + (size_t)x];
}

static void other_row(float *rgb, float *rgb_sigma, const plane *m, const cfa *f, int y, int greens)
{
    for (int x = 0; x < m->w; x++) {
        size_t at = (size_t)y * (size_t)m->w + (size_t)x;
        for (int c = greens ? 1 : 0; c < 3; c += greens ? 3 : 2) {
            float *v = rgb + 3 * at + c, *sd = rgb_sigma ? rgb_sigma + 3 * at + c : NULL;
            if (c != cfa_at(f, x, y)) {
                around(v, sd, m, f, greens ? NULL : rgb, c, x, y);
                continue;
            }
            *v = m->p[at];
            if (sd) *sd = m->s[at];
        }
    }
}

int demosaic(float *rgb, float *rgb_sigma, const float *mosaic, const float *sigma, int width, int height,
             const cfa *pattern, errmsg *e)
{
    plane m = {mosaic, sigma, width, height};
    int bayer = cfa_is_bayer(pattern);
    if (width < 2 || height < 2)
        return err_set(e, "expected a mosaic of 2x2 pixels or more, found %dx%d", width, height);
#pragma omp parallel for schedule(static)
    for (int y = 0; y < height; y++) {
        if (bayer) bayer_row(rgb, rgb_sigma, &m, pattern, y);
        else other_row(rgb, rgb_sigma, &m, pattern, y, 1);
    }
#pragma omp parallel for schedule(static)
    for (int y = 0; y < height; y++)
        if (!bayer) other_row(rgb, rgb_sigma, &m, pattern, y, 0);
    return 0;
}

void mosaic_half(float *rgb, float *rgb_sigma, const float *mosaic, const float *sigma, int width, int height,
                 const cfa *pattern)
{
    static const float share[3] = {1, .5f, 1};
    int w = width / 2, h = height / 2;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            size_t out = 3 * ((size_t)y * (size_t)w + (size_t)x);
            float v[3] = {0}, var[3] = {0};
            for (int i = 0; i < 4; i++) {
                size_t at = (size_t)(2 * y + i / 2) * (size_t)width + (size_t)(2 * x + i % 2);
                int c = cfa_at(pattern, i % 2, i / 2);
                v[c] += share[c] * mosaic[at];
                var[c] += sigma ? share[c] * share[c] * sigma[at] * sigma[at] : 0;
            }
            for (size_t c = 0; c < 3; c++) {
                rgb[out + c] = v[c];
                if (rgb_sigma) rgb_sigma[out + c] = sqrtf(var[c]);
            }
        }
}
