/*
 * samples.c - choosing sample pixels while the rows stream by; see samples.h.
 */
#include "samples.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TRIES = 4 };

int sampler_init(sampler *p, int width, int height, int exposures, int channels, int max_code,
                 const cfa *mosaic, int with_dark, int wanted, errmsg *e)
{
    memset(p, 0, sizeof *p);
    p->width = width;
    p->height = height;
    p->mosaic = mosaic;
    p->lanes = mosaic ? 1 : channels;
    p->s.exposures = exposures;
    p->s.channels = channels;
    p->s.max_code = max_code;
    p->s.width = width;
    p->s.height = height;
    p->s.mosaic = mosaic != NULL;
    double area = (double)width * height;
    int cell = (int)floor(sqrt(area / wanted));
    if (mosaic && cell < 2) cell = 2;
    p->cell = cell < 1 ? 1 : cell;
    p->s.cap = ((width + p->cell - 1) / p->cell) * ((height + p->cell - 1) / p->cell);
    for (int c = 0; c < channels; c++) {
        p->s.clip[c] = max_code;
        p->s.z[c] = malloc((size_t)p->s.cap * (size_t)exposures * sizeof *p->s.z[c]);
        if (with_dark) p->s.dark[c] = malloc((size_t)p->s.cap * sizeof *p->s.dark[c]);
        p->s.out[c] = calloc((size_t)p->s.cap, 1);
        p->s.at[c] = malloc((size_t)p->s.cap * sizeof *p->s.at[c]);
        p->s.steep[c] = malloc((size_t)p->s.cap * sizeof *p->s.steep[c]);
        if (!p->s.z[c] || !p->s.out[c] || !p->s.at[c] || !p->s.steep[c] || (with_dark && !p->s.dark[c])) {
            samples_free(&p->s);
            return err_set(e, "out of memory for %d sample pixels", p->s.cap);
        }
    }
    return 0;
}

void samples_free(samples *s)
{
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) {
        free(s->z[c]);
        free(s->dark[c]);
        free(s->gone[c]);
        free(s->out[c]);
        free(s->at[c]);
        free(s->steep[c]);
    }
    memset(s, 0, sizeof *s);
}

/* The same places for the same picture, whatever the strips and threads. */
static uint32_t hash(uint32_t x, uint32_t y, uint32_t t)
{
    uint32_t h = x * 0x9E3779B1u ^ y * 0x85EBCA77u ^ t * 0xC2B2AE3Du;
    h ^= h >> 15;
    h *= 0x2C1B3C6Du;
    h ^= h >> 12;
    h *= 0x297A2D39u;
    return h ^ h >> 15;
}

/* Sum over the exposures of the code's change to the neighbours inside the strip. */
static long gradient(const sampler *p, const uint16_t *const *codes, int x, int y, int rows)
{
    int d = p->mosaic ? p->mosaic->columns : 1, step = p->lanes, g = p->lanes == 3 ? 1 : 0;
    int x0 = x >= d ? x - d : x, x1 = x + d < p->width ? x + d : x;
    int y0 = y >= d ? y - d : y, y1 = y + d < rows ? y + d : y;
    size_t row = (size_t)p->width * (size_t)step;
    long sum = 0;
    for (int k = 0; k < p->s.exposures; k++) {
        const uint16_t *z = codes[k] + g;
        sum += labs((long)z[(size_t)y * row + (size_t)(x1 * step)] -
                    (long)z[(size_t)y * row + (size_t)(x0 * step)]) +
               labs((long)z[(size_t)y1 * row + (size_t)(x * step)] -
                    (long)z[(size_t)y0 * row + (size_t)(x * step)]);
    }
    return sum;
}

static int need_masks(sampler *p, const uint8_t *const *missing, errmsg *e)
{
    samples *s = &p->s;
    int any = 0;
    for (int k = 0; k < s->exposures; k++) any |= missing[k] != NULL;
    for (int c = 0; any && c < s->channels; c++)
        if (!s->gone[c] && !(s->gone[c] = calloc((size_t)s->cap, (size_t)s->exposures)))
            return err_set(e, "out of memory for %d sample pixels", s->cap);
    return 0;
}

static void take(sampler *p, const uint16_t *const *codes, const uint8_t *const *missing,
                 const uint16_t *dark, int x, int y, int at_y, long slope)
{
    samples *s = &p->s;
    size_t at = ((size_t)y * (size_t)p->width + (size_t)x) * (size_t)p->lanes;
    int first = p->mosaic ? cfa_at(p->mosaic, x, at_y) : 0;
    for (int l = 0; l < p->lanes; l++) {
        int c = first + l;
        if (s->n[c] == s->cap) continue;
        if (dark) s->dark[c][s->n[c]] = dark[at + (size_t)l];
        s->at[c][s->n[c]] = (uint32_t)at_y * (uint32_t)p->width + (uint32_t)x;
        float sum = 1;
        size_t to = (size_t)s->n[c] * (size_t)s->exposures;
        for (int k = 0; k < s->exposures; k++) {
            s->z[c][to + (size_t)k] = codes[k][at + (size_t)l];
            sum += codes[k][at + (size_t)l];
            if (missing[k]) s->gone[c][to + (size_t)k] = missing[k][(size_t)y * (size_t)p->width + (size_t)x];
        }
        s->steep[c][s->n[c]++] = (float)slope / sum;
    }
}

int sampler_strip(sampler *p, const uint16_t *const *codes, const uint8_t *const *missing,
                  const uint16_t *dark, int y0, int rows, errmsg *e)
{
    int cell = p->cell;
    if (need_masks(p, missing, e)) return -1;
    /* a cell belongs to the strip that holds its first row, and is cut off at the strip's end */
    for (int cy = (y0 + cell - 1) / cell * cell; cy < y0 + rows; cy += cell) {
        int high = cy + cell <= y0 + rows ? cell : y0 + rows - cy;
        for (int cx = 0; cx < p->width; cx += cell) {
            int wide = cx + cell <= p->width ? cell : p->width - cx;
            int best_x = cx, best_y = cy;
            long least = -1;
            for (uint32_t t = 0; t < TRIES; t++) {
                uint32_t h = hash((uint32_t)cx, (uint32_t)cy, t);
                int x = cx + (int)((h & 0xffff) % (uint32_t)wide);
                int y = cy + (int)((h >> 16) % (uint32_t)high);
                long g = gradient(p, codes, x, y - y0, rows);
                if (least < 0 || g < least) {
                    least = g;
                    best_x = x;
                    best_y = y;
                }
                if (cell == 1) break;
            }
            take(p, codes, missing, dark, best_x, best_y - y0, best_y, least);
        }
    }
    return 0;
}
