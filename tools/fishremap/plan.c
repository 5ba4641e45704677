/*
 * plan.c - weights made once, for any number of pictures (remap.h).
 *
 * Kept per band of destination rows, in the order of the source's pixels: a picture is then read once from
 * top to bottom, a pixel's slopes are made when it is met, and what it gives goes to the band's texels,
 * which stay in the cache.  Sums don't depend on the number of threads: a band is one thread's.
 */
#include <stdlib.h>
#include <string.h>

#include "weights.h"

typedef struct piece {
    uint32_t texel; /* within the band */
    float w, wx, wy;
} piece;

typedef struct giver {
    uint16_t x, y; /* source pixel */
    uint32_t end;  /* its pieces are those from the giver before it up to here */
} giver;

typedef struct band {
    giver *g;
    piece *p;
    float *alpha;
    size_t ng, np;
} band;

struct remap_plan {
    int width, height, nbands;
    int wrap; /* the source's x has a period */
    band *bands;
};

enum { ROWS = 4 * BAND }; /* of a band */

/* What one thread collects of a band before it is put in order. */
typedef struct gather {
    uint32_t *texel;
    entry *e;
    size_t n, room;
    uint32_t *count; /* per source pixel */
} gather;

static void gather_free(gather *a)
{
    free(a->texel);
    free(a->e);
    free(a->count);
}

static int gather_row(gather *a, const row *r, int width, uint32_t first)
{
    if (a->n + r->n > a->room) {
        a->room = 2 * (a->n + r->n);
        void *t = realloc(a->texel, a->room * sizeof *a->texel), *e = t ? realloc(a->e, a->room * sizeof *a->e) : NULL;
        if (t) a->texel = t;
        if (!e) return -1;
        a->e = e;
    }
    size_t i = 0;
    for (int x = 0; x < width; x++)
        for (; i < r->end[x]; i++) {
            a->texel[a->n] = first + (uint32_t)x;
            a->e[a->n++] = r->e[i];
        }
    return 0;
}

/* Counting sort by source pixel, stable, so texels stay in ascending order. */
static int put_in_order(band *b, gather *a, const chart *src)
{
    size_t npx = (size_t)src->width * (size_t)src->height;
    memset(a->count, 0, (npx + 1) * sizeof *a->count);
    for (size_t i = 0; i < a->n; i++) a->count[a->e[i].px + 1]++;
    for (size_t k = 0; k < npx; k++) b->ng += a->count[k + 1] > 0;
    b->np = a->n;
    b->g = malloc((b->ng + 1) * sizeof *b->g);
    b->p = malloc((b->np + 1) * sizeof *b->p);
    if (!b->g || !b->p) return -1;
    size_t g = 0;
    for (size_t k = 0; k < npx; k++) {
        uint32_t here = a->count[k + 1];
        a->count[k + 1] += a->count[k];
        if (here) b->g[g++] = (giver){(uint16_t)(k % (size_t)src->width), (uint16_t)(k / (size_t)src->width), a->count[k + 1]};
    }
    for (size_t i = 0; i < a->n; i++) {
        const entry *e = a->e + i;
        b->p[a->count[e->px]++] = (piece){a->texel[i], e->w, e->wx, e->wy};
    }
    return 0;
}

static int band_make(band *b, gather *a, row *r, bench *t, const geometry *g, int from, int to)
{
    int w = g->dst->width;
    a->n = 0;
    b->alpha = malloc(sizeof(float) * (size_t)w * (size_t)(to - from));
    if (!b->alpha) return -1;
    for (int y = from; y < to; y++) {
        if (row_make(r, t, g, y) || gather_row(a, r, w, (uint32_t)(y - from) * (uint32_t)w)) return -1;
        memcpy(b->alpha + (size_t)(y - from) * (size_t)w, r->alpha, sizeof(float) * (size_t)w);
    }
    return put_in_order(b, a, g->src);
}

int remap_plan_new(remap_plan **plan, const chart *dst, const chart *src, errmsg *e)
{
    geometry g;
    if (src->width > 65535 || src->height > 65535)
        return err_set(e, "expected pictures of less than 65536 pixels a side to share weights, found %d x %d", src->width, src->height);
    remap_plan *p = calloc(1, sizeof *p);
    int failed = 0, h = dst->height, n = (h + ROWS - 1) / ROWS;
    if (!p || !(p->bands = calloc((size_t)n, sizeof *p->bands))) {
        free(p);
        return err_set(e, "out of memory");
    }
    p->width = dst->width, p->height = h, p->nbands = n;
    p->wrap = src->kind == CHART_GRID && src->lon_span > 6.2831853;
    if (geometry_init(&g, dst, src, NULL, e)) {
        remap_plan_free(p);
        return -1;
    }
#pragma omp parallel reduction(| : failed)
    {
        bench t;
        row r;
        gather a = {0};
        failed |= bench_init(&t, &g) | row_init(&r, p->width);
        a.count = malloc(((size_t)src->width * (size_t)src->height + 1) * sizeof *a.count);
        failed |= !a.count;
#pragma omp for schedule(dynamic)
        for (int k = 0; k < n; k++)
            if (!failed && band_make(p->bands + k, &a, &r, &t, &g, k * ROWS, k * ROWS + ROWS < h ? k * ROWS + ROWS : h)) failed = 1;
        gather_free(&a);
        bench_free(&t);
        row_free(&r);
    }
    geometry_free(&g);
    if (failed) {
        remap_plan_free(p);
        return err_set(e, "out of memory");
    }
    *plan = p;
    return 0;
}

void remap_plan_free(remap_plan *p)
{
    if (!p) return;
    for (int k = 0; k < p->nbands; k++) {
        free(p->bands[k].g);
        free(p->bands[k].p);
        free(p->bands[k].alpha);
    }
    free(p->bands);
    free(p);
}

int64_t remap_plan_size(const remap_plan *p)
{
    int64_t n = 0;
    for (int k = 0; k < p->nbands; k++) n += (int64_t)p->bands[k].np;
    return n;
}

/* sum: the band's texels, 4 floats each, zero to begin with. */
static void give(slope_v4 *sum, const band *b, const remap_source *s, int wrap)
{
    int w = s->width, h = s->height;
    const slope_v4 *pix = (const slope_v4 *)s->pix;
    const piece *p = b->p;
    for (size_t k = 0; k < b->ng; k++) {
        int x = b->g[k].x, y = b->g[k].y;
        const slope_v4 *c = pix + (size_t)y * (size_t)w + (size_t)x, *end_of_row = pix + (size_t)(y + 1) * (size_t)w;
        const slope_v4 *left = x > 0 ? c - 1 : wrap ? end_of_row - 1 : c, *right = x + 1 < w ? c + 1 : wrap ? end_of_row - w : c;
        const slope_v4 *up = y > 0 ? c - w : c, *down = y + 1 < h ? c + w : c;
        slope_v4 v = *c, gx, gy;
        slope_pixel(&gx, &gy, v, *left, *right, *up, *down);
        for (const piece *end = b->p + b->g[k].end; p < end; p++) sum[p->texel] += p->w * v + p->wx * gx + p->wy * gy;
    }
}

int remap_apply(float *rgb, float *alpha, const remap_plan *p, const remap_source *s, errmsg *e)
{
    int failed = 0;
#pragma omp parallel reduction(| : failed)
    {
        slope_v4 *sum = aligned_alloc(16, sizeof *sum * (size_t)p->width * ROWS);
#pragma omp for schedule(dynamic)
        for (int k = 0; k < p->nbands; k++) {
            int from = k * ROWS, to = from + ROWS < p->height ? from + ROWS : p->height;
            size_t n = (size_t)p->width * (size_t)(to - from), at = (size_t)from * (size_t)p->width;
            if (!sum) {
                failed = 1;
                continue;
            }
            memset(sum, 0, n * sizeof *sum);
            give(sum, p->bands + k, s, p->wrap);
            for (size_t i = 0; i < n; i++)
                for (size_t c = 0; c < 3; c++) rgb[3 * (at + i) + c] = sum[i][c];
            if (alpha) memcpy(alpha + at, p->bands[k].alpha, n * sizeof *alpha);
        }
        free(sum);
    }
    return failed ? err_set(e, "out of memory") : 0;
}
