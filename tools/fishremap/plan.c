/*
 * plan.c - weights made once, for any number of pictures (remap.h).
 *
 * Kept per band of destination rows, in the order of the source's pixels: a picture is then read once from
 * top to bottom, and what a pixel gives goes to the band's texels, which stay in the cache.  A pixel that no
 * outline cuts gives its mean, whatever its slopes: runs of such pixels are a plain sum of products.  Slopes
 * are made, as they are met, for those alone that are cut:
 *
 *      . . . . / . . .     of a large texel's pixels nearly all are whole;
 *      . . . / . . . .     those under the line give to both texels
 *
 * Sums don't depend on the number of threads: a band is one thread's.
 */
#include <math.h>
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

typedef struct run {
    uint32_t px, n, texel; /* pixels px, px + 1, ... that lie within one texel; n is a multiple of 4, weights
                              beyond them are 0 */
} run;

typedef struct band {
    giver *g; /* pixels that are cut */
    piece *p;
    run *r;
    float *w; /* of the runs' pixels, one after the other */
    float *alpha;
    size_t ng, np, nr, nw;
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
        void *t = realloc(a->texel, a->room * sizeof *a->texel),
             *e = t ? realloc(a->e, a->room * sizeof *a->e) : NULL;
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
        if (here)
            b->g[g++] = (giver){(uint16_t)(k % (size_t)src->width), (uint16_t)(k / (size_t)src->width),
                                a->count[k + 1]};
    }
    for (size_t i = 0; i < a->n; i++) {
        const entry *e = a->e + i;
        b->p[a->count[e->px]++] = (piece){a->texel[i], e->w, e->wx, e->wy};
    }
    return 0;
}

/* Fill the last run up to a multiple of 4 with weights of 0: behind it, or before it where the picture ends.
 */
static void end_run(band *b, size_t npx)
{
    run *r = b->nr ? b->r + b->nr - 1 : NULL;
    if (!r || r->n % 4 == 0) return;
    uint32_t n = r->n, all = (n + 3) & ~3u, first = r->px + all > npx ? (uint32_t)npx - all : r->px,
             lead = r->px - first;
    float *w = b->w + b->nw - n;
    memmove(w + lead, w, n * sizeof *w);
    memset(w, 0, lead * sizeof *w);
    memset(w + lead + n, 0, (all - n - lead) * sizeof *w);
    *r = (run){first, all, r->texel};
    b->nw += all - n;
}

/* Overlaps whose centroid is the pixel's own become runs; what is cut moves up.  A run is no longer than
 * what the picture has in fours, so that it can be filled up. */
static int find_runs(band *b, size_t npx, size_t width)
{
    size_t ng = 0, np = 0, from = 0, room = 0, most = npx & ~(size_t)3;
    b->w = malloc((4 * b->ng + 4) * sizeof *b->w);
    if (!b->w) return -1;
    for (size_t k = 0; k < b->ng; k++) {
        giver g = b->g[k];
        const piece *p = b->p + from;
        uint32_t px = (uint32_t)(g.y * width + g.x);
        size_t n = g.end - from;
        from = g.end;
        if (n > 1 || fabsf(p->wx) + fabsf(p->wy) > 1e-7f * p->w || !most) {
            memmove(b->p + np, p, n * sizeof *p);
            np += n;
            g.end = (uint32_t)np;
            b->g[ng++] = g;
            continue;
        }
        run *r = b->nr ? b->r + b->nr - 1 : NULL;
        if (!r || r->texel != p->texel || r->px + r->n != px || r->n == most) {
            end_run(b, npx);
            if (b->nr == room) {
                room = room ? 2 * room : 256;
                run *q = realloc(b->r, room * sizeof *q);
                if (!q) return -1;
                b->r = q;
            }
            r = b->r + b->nr++;
            *r = (run){px, 0, p->texel};
        }
        b->w[b->nw++] = p->w;
        r->n++;
    }
    end_run(b, npx);
    b->ng = ng, b->np = np;
    float *w = realloc(b->w, (b->nw + 1) * sizeof *w); /* a smaller block, if there is one */
    if (w) b->w = w;
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
    return put_in_order(b, a, g->src) ||
                   find_runs(b, (size_t)g->src->width * (size_t)g->src->height, (size_t)g->src->width)
               ? -1
               : 0;
}

int remap_plan_new(remap_plan **plan, const chart *dst, const chart *src, errmsg *e)
{
    geometry g;
    if (src->width > 65535 || src->height > 65535)
        return err_set(e,
                       "expected pictures of less than 65536 pixels a side to share weights, found %d x %d",
                       src->width, src->height);
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
            if (!failed &&
                band_make(p->bands + k, &a, &r, &t, &g, k * ROWS, k * ROWS + ROWS < h ? k * ROWS + ROWS : h))
                failed = 1;
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
        free(p->bands[k].r);
        free(p->bands[k].w);
        free(p->bands[k].alpha);
    }
    free(p->bands);
    free(p);
}

int64_t remap_plan_size(const remap_plan *p)
{
    int64_t n = 0;
    for (int k = 0; k < p->nbands; k++) n += (int64_t)(p->bands[k].np + p->bands[k].nw);
    return n;
}

/* What the whole pixels give, run by run from *k on as long as a run begins before pixel `until`; *w goes
 * along. */
static void give_runs(slope_v4 *sum, size_t *k, const float **w, const band *b, const slope_v4 *pix,
                      size_t until)
{
    const float *q = *w;
    size_t j = *k;
    for (; j < b->nr && b->r[j].px < until; j++) {
        const slope_v4 *v = pix + b->r[j].px;
        uint32_t n = b->r[j].n;
        slope_v4 s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
        for (uint32_t i = 0; i < n; i += 4)
            s0 += q[i] * v[i], s1 += q[i + 1] * v[i + 1], s2 += q[i + 2] * v[i + 2],
                s3 += q[i + 3] * v[i + 3];
        sum[b->r[j].texel] += (s0 + s1) + (s2 + s3);
        q += n;
    }
    *k = j, *w = q;
}

/* All that a band's pixels give.  sum: the band's texels, 4 floats each.  Whole pixels go first, a row ahead
 * of those that are cut, which then find their neighbours in the cache. */
static void give(slope_v4 *sum, const band *b, const remap_source *s, int wrap)
{
    enum { AHEAD = 64 }; /* pieces; they are read once, and there are more of them than pixels */
    int w = s->width, last = -1;
    const slope_v4 *pix = (const slope_v4 *)s->pix;
    const piece *p = b->p;
    const float *weight = b->w;
    size_t done = 0;
    for (size_t k = 0; k < b->ng; k++) {
        int x = b->g[k].x, y = b->g[k].y;
        if (y != last) give_runs(sum, &done, &weight, b, pix, (size_t)(y + 2) * (size_t)w);
        last = y;
        slope_v4 v = pix[(size_t)y * (size_t)w + (size_t)x], gx, gy;
        slope_at(&gx, &gy, s, x, y, wrap, 1);
        __builtin_prefetch(p + AHEAD);
        __builtin_prefetch(p + AHEAD + 4); /* the next cache line */
        for (const piece *end = b->p + b->g[k].end; p < end; p++)
            sum[p->texel] += p->w * v + p->wx * gx + p->wy * gy;
    }
    give_runs(sum, &done, &weight, b, pix, SIZE_MAX);
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
