/*
 * remap.c - plans of weights and their use (remap.h).
 *
 * For texel t and source pixel p:  w = overlap area x (solid angle per area at p), and
 *   out(t) = sum_p w (L_p + g_p . c_tp) / sum_p w,   c_tp the overlap's centroid about p's centre;
 * the sum of w over t is p's solid angle, so sum_t out(t) Omega(t) = sum_p L_p Omega(p).
 */
#include "remap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "overlap.h"
#include "outline.h"

typedef struct entry {
    uint32_t px;      /* source pixel */
    float w, wx, wy;  /* weight and weighted offset from the pixel's centre, of sum(w) = 1 */
} entry;

typedef struct row {
    entry *e;
    size_t n, room;
    size_t *end;   /* texel x owns e[end[x-1]..end[x]) */
    float *alpha;
} row;

struct remap_plan {
    int width, height;
    row *rows;
};

/* What all threads share while weights are made. */
typedef struct geometry {
    const chart *dst, *src;
    const unsigned char *skip;
    float *per_area; /* solid angle per pixel area; disc: per pixel, grid: per row */
} geometry;

/* What one thread needs. */
typedef struct bench {
    outliner *lines;
    overlap *cells;
    overlap_cell *span;
    size_t span_room;
    double *rim; /* contour of the image circle, for the texel around the far pole */
    int nrim;
} bench;

#define TABLE 16384

static int geometry_init(geometry *g, const chart *dst, const chart *src, const unsigned char *skip, errmsg *e)
{
    memset(g, 0, sizeof *g);
    g->dst = dst, g->src = src, g->skip = skip;
    int w = src->width, h = src->height;
    if (src->kind == CHART_GRID) {
        g->per_area = malloc(sizeof(float) * (size_t)h);
        if (!g->per_area) return err_set(e, "out of memory");
        for (int y = 0; y < h; y++) g->per_area[y] = (float)chart_pixel_solid_angle(src, 0, y);
        return 0;
    }
    float *table = malloc(sizeof(float) * (TABLE + 2));
    g->per_area = malloc(sizeof(float) * (size_t)w * (size_t)h);
    if (!table || !g->per_area) {
        free(table);
        free(g->per_area);
        return err_set(e, "out of memory");
    }
    for (int k = 0; k <= TABLE + 1; k++)
        table[k] = (float)(lens_solid_angle(&src->lens, (double)k / TABLE) / (src->radius * src->radius));
    float scale = (float)(TABLE / src->radius), limit = (float)(src->radius + M_SQRT1_2) * scale;
#pragma omp parallel for schedule(static)
    for (int y = 0; y < h; y++) {
        float *q = g->per_area + (size_t)y * (size_t)w;
        float dy = (float)(y + 0.5 - src->cy), x0 = (float)(0.5 - src->cx);
        for (int x = 0; x < w; x++) {
            float dx = x0 + (float)x, r = sqrtf(dx * dx + dy * dy) * scale, k = fminf(r, TABLE);
            int i = (int)k;
            q[x] = r > limit ? 0 : table[i] + (k - (float)i) * (table[i + 1] - table[i]);
        }
    }
    free(table);
    return 0;
}

static void bench_free(bench *b)
{
    outliner_free(b->lines);
    overlap_free(b->cells);
    free(b->span);
    free(b->rim);
}

static int bench_init(bench *b, const geometry *g)
{
    memset(b, 0, sizeof *b);
    b->lines = outliner_new(g->dst, g->src);
    b->cells = overlap_new();
    if (!b->lines || !b->cells) return -1;
    if (g->src->kind == CHART_DISC) {
        b->nrim = 4096;
        b->rim = malloc(sizeof(double) * 2 * (size_t)b->nrim);
        if (!b->rim) return -1;
        double step = outliner_sense(b->lines) * 2 * M_PI / b->nrim;
        for (int k = 0; k < b->nrim; k++) {
            b->rim[2 * k] = g->src->cx + g->src->radius * cos(k * step);
            b->rim[2 * k + 1] = g->src->cy + g->src->radius * sin(k * step);
        }
    }
    return 0;
}

static double twice_area(const double *xy, int n)
{
    double s = 0, x0 = xy[0], y0 = xy[1];
    for (int i = 1; i + 1 < n; i++)
        s += (xy[2 * i] - x0) * (xy[2 * i + 3] - y0) - (xy[2 * i + 2] - x0) * (xy[2 * i + 1] - y0);
    return s;
}

static void bounds(double box[4], const double *xy, int n)
{
    box[0] = box[2] = xy[0], box[1] = box[3] = xy[1];
    for (int i = 1; i < n; i++) {
        box[0] = fmin(box[0], xy[2 * i]), box[2] = fmax(box[2], xy[2 * i]);
        box[1] = fmin(box[1], xy[2 * i + 1]), box[3] = fmax(box[3], xy[2 * i + 1]);
    }
}

static int clamp_int(double v, int lo, int hi)
{
    return v < lo ? lo : v > hi ? hi : (int)v;
}

static int row_push(row *r, uint32_t px, double w, double wx, double wy)
{
    if (r->n == r->room) {
        size_t room = r->room ? 2 * r->room : 4096;
        entry *q = realloc(r->e, room * sizeof *q);
        if (!q) return -1;
        r->e = q, r->room = room;
    }
    r->e[r->n++] = (entry){px, (float)w, (float)wx, (float)wy};
    return 0;
}

/* Overlaps of the contour begun in b->cells become entries; *total gets the solid angle. */
static int collect(double *total, row *r, bench *b, const geometry *g, int x0, int y0, int x1, int y1, int sense)
{
    const chart *s = g->src;
    size_t w = (size_t)(x1 - x0);
    if (w > b->span_room) {
        free(b->span);
        b->span = malloc(w * sizeof *b->span);
        b->span_room = b->span ? w : 0;
        if (!b->span) return -1;
    }
    for (int y = y0; y < y1; y++) {
        overlap_row(b->span, b->cells, y);
        for (int x = x0; x < x1; x++) {
            const overlap_cell *c = b->span + (x - x0);
            double area = sense * c->area;
            if (area < 1e-9) continue;
            int px = x;
            if (s->kind == CHART_GRID) px = ((x % s->width) + s->width) % s->width;
            size_t at = (size_t)y * (size_t)s->width + (size_t)px;
            double j = g->per_area[s->kind == CHART_GRID ? (size_t)y : at];
            if (j <= 0 || (g->skip && g->skip[at])) continue;
            if (row_push(r, (uint32_t)at, area * j, sense * c->mx * j, sense * c->my * j)) return -1;
            *total += area * j;
        }
    }
    return 0;
}

static int texel(row *r, bench *b, const geometry *g, int x, int y)
{
    const chart *s = g->src;
    const double *xy;
    int n, sense = outliner_sense(b->lines), rc = outliner_texel(&xy, &n, b->lines, x);
    size_t first = r->n;
    double total = 0;
    r->alpha[x] = 0;
    if (rc <= 0) return rc;
    double box[4];
    bounds(box, xy, n);
    int around = 0;
    if (s->kind == CHART_DISC && b->rim) { /* inside out: the texel around the far pole */
        double a = sense * twice_area(xy, n) / 2;
        around = a < -0.25 * M_PI * s->radius * s->radius;
        if (around) bounds(box, b->rim, b->nrim);
    }
    int wraps = s->kind == CHART_GRID && s->lon_span > 2 * M_PI * (1 - 1e-12);
    int x0 = wraps ? (int)floor(box[0]) : clamp_int(floor(box[0]), 0, s->width);
    int x1 = wraps ? (int)ceil(box[2]) : clamp_int(ceil(box[2]), 0, s->width);
    int y0 = clamp_int(floor(box[1]), 0, s->height), y1 = clamp_int(ceil(box[3]), 0, s->height);
    if (x1 > x0 && y1 > y0) {
        if (overlap_begin(b->cells, x0, y0, x1, y1)) return -1;
        overlap_contour(b->cells, xy, n);
        if (around) overlap_contour(b->cells, b->rim, b->nrim);
        if (collect(&total, r, b, g, x0, y0, x1, y1, sense)) return -1;
    }
    if (total > 0) {
        float k = (float)(1 / total);
        for (size_t i = first; i < r->n; i++) r->e[i].w *= k, r->e[i].wx *= k, r->e[i].wy *= k;
        double full = chart_pixel_solid_angle(g->dst, x, y), a = full > 0 ? total / full : 0;
        r->alpha[x] = (float)(a > 0.998 ? 1 : a);
    }
    return 0;
}

static int row_init(row *r, int width)
{
    memset(r, 0, sizeof *r);
    r->end = malloc(sizeof *r->end * (size_t)width);
    r->alpha = malloc(sizeof *r->alpha * (size_t)width);
    return r->end && r->alpha ? 0 : -1;
}

static void row_free(row *r)
{
    free(r->e);
    free(r->end);
    free(r->alpha);
}

static int row_make(row *r, bench *b, const geometry *g, int y)
{
    r->n = 0;
    if (outliner_row(b->lines, y)) return -1;
    for (int x = 0; x < g->dst->width; x++) {
        if (texel(r, b, g, x, y)) return -1;
        r->end[x] = r->n;
    }
    return 0;
}

typedef float v4 __attribute__((vector_size(16), aligned(4)));

static void row_apply(float *rgb, float *alpha, const row *r, int width, const remap_source *s)
{
    size_t i = 0;
    for (int x = 0; x < width; x++) {
        double total[3] = {0, 0, 0};
        while (i < r->end[x]) { /* short runs in float, their sum in double: a pole's texel has thousands */
            size_t stop = i + 64 < r->end[x] ? i + 64 : r->end[x];
            v4 sum = {0, 0, 0, 0};
            for (; i < stop; i++) {
                const entry *e = r->e + i;
                const float *q = s->px + (size_t)e->px * SRC_FLOATS;
                sum += e->w * *(const v4 *)q + e->wx * *(const v4 *)(q + 3) + e->wy * *(const v4 *)(q + 6);
            }
            for (int c = 0; c < 3; c++) total[c] += (double)sum[c];
        }
        for (int c = 0; c < 3; c++) rgb[3 * x + c] = (float)total[c];
        if (alpha) alpha[x] = r->alpha[x];
    }
}

#define BAND 8 /* rows a thread takes at a time: neighbours share a line */

int remap_plan_new(remap_plan **plan, const chart *dst, const chart *src, const unsigned char *skip, errmsg *e)
{
    geometry g;
    remap_plan *p = calloc(1, sizeof *p);
    int failed = 0, h = dst->height;
    if (!p || !(p->rows = calloc((size_t)h, sizeof *p->rows))) {
        free(p);
        return err_set(e, "out of memory");
    }
    p->width = dst->width, p->height = h;
    if (geometry_init(&g, dst, src, skip, e)) {
        remap_plan_free(p);
        return -1;
    }
#pragma omp parallel reduction(| : failed)
    {
        bench b;
        row all;
        failed |= bench_init(&b, &g) | row_init(&all, p->width);
#pragma omp for schedule(dynamic)
        for (int band = 0; band < (h + BAND - 1) / BAND; band++) {
            for (int y = band * BAND; y < h && y < (band + 1) * BAND && !failed; y++) {
                row *r = p->rows + y;
                if (row_make(&all, &b, &g, y) || row_init(r, p->width) || !(r->e = malloc(all.n * sizeof *r->e + 1))) {
                    failed = 1;
                    break;
                }
                r->n = r->room = all.n;
                memcpy(r->e, all.e, all.n * sizeof *r->e);
                memcpy(r->end, all.end, sizeof *r->end * (size_t)p->width);
                memcpy(r->alpha, all.alpha, sizeof *r->alpha * (size_t)p->width);
            }
        }
        bench_free(&b);
        row_free(&all);
    }
    free(g.per_area);
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
    for (int y = 0; y < p->height; y++) row_free(p->rows + y);
    free(p->rows);
    free(p);
}

int64_t remap_plan_size(const remap_plan *p)
{
    int64_t n = 0;
    for (int y = 0; y < p->height; y++) n += (int64_t)p->rows[y].n;
    return n;
}

void remap_apply(float *rgb, float *alpha, const remap_plan *p, const remap_source *s)
{
#pragma omp parallel for schedule(dynamic, BAND)
    for (int y = 0; y < p->height; y++) {
        size_t at = (size_t)y * (size_t)p->width;
        row_apply(rgb + 3 * at, alpha ? alpha + at : NULL, p->rows + y, p->width, s);
    }
}

int remap_run(float *rgb, float *alpha, const chart *dst, const chart *src, const remap_source *s, errmsg *e)
{
    geometry g;
    int failed = 0, h = dst->height, w = dst->width;
    if (geometry_init(&g, dst, src, s->bad, e)) return -1;
#pragma omp parallel reduction(| : failed)
    {
        bench b;
        row r;
        failed |= bench_init(&b, &g) | row_init(&r, w);
#pragma omp for schedule(dynamic)
        for (int band = 0; band < (h + BAND - 1) / BAND; band++) {
            for (int y = band * BAND; y < h && y < (band + 1) * BAND && !failed; y++) {
                size_t at = (size_t)y * (size_t)w;
                failed |= row_make(&r, &b, &g, y);
                if (!failed) row_apply(rgb + 3 * at, alpha ? alpha + at : NULL, &r, w, s);
            }
        }
        bench_free(&b);
        row_free(&r);
    }
    free(g.per_area);
    return failed ? err_set(e, "out of memory") : 0;
}
