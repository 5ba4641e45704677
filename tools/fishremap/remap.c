/*
 * remap.c - remap of one picture, weights made and used row by row (remap.h).
 */
#include "remap.h"

#include <math.h>

#include "weights.h"

/* One row of texels.  A pixel that lies wholly within a texel gives its mean, whatever its slopes: those are
 * made for the rest alone. */
static void row_apply(float *rgb, float *alpha, const row *r, int width, const remap_source *s, int wrap)
{
    enum {
        AHEAD = 32
    }; /* pixels; a texel's lie in short stretches of many lines, which no processor foresees */
    const slope_v4 *pix = (const slope_v4 *)s->pix;
    const uint32_t w = (uint32_t)s->width;
    uint32_t line = 0; /* the first pixel of the line of the picture that is at hand, and its number */
    int y = 0;
    size_t i = 0;
    for (int x = 0; x < width; x++) {
        double total[3] = {0, 0, 0};
        while (i < r->end[x]) { /* short runs in float, their sum in double: a pole's texel has thousands */
            size_t stop = i + 64 < r->end[x] ? i + 64 : r->end[x];
            slope_v4 sum = {0, 0, 0, 0};
            for (; i < stop; i++) {
                const entry *e = r->e + i;
                __builtin_prefetch(pix + e[i + AHEAD < r->n ? AHEAD : 0].px);
                sum += e->w * pix[e->px];
                if (fabsf(e->wx) + fabsf(e->wy) <= 1e-7f * e->w) continue;
                if (e->px - line >= w) {
                    y = (int)(e->px / w);
                    line = (uint32_t)y * w;
                }
                slope_v4 gx, gy;
                slope_at(&gx, &gy, s, (int)(e->px - line), y, wrap, !s->bad);
                sum += e->wx * gx + e->wy * gy;
            }
            for (int c = 0; c < 3; c++) total[c] += (double)sum[c];
        }
        for (int c = 0; c < 3; c++) rgb[3 * x + c] = (float)total[c];
        if (alpha) alpha[x] = r->alpha[x];
    }
}

int remap_run(float *rgb, float *alpha, const chart *dst, const chart *src, const remap_source *s, errmsg *e)
{
    geometry g;
    int failed = 0, h = dst->height, w = dst->width,
        wrap = src->kind == CHART_GRID && src->lon_span > 2 * M_PI * (1 - 1e-12);
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
                if (!failed) row_apply(rgb + 3 * at, alpha ? alpha + at : NULL, &r, w, s, wrap);
            }
        }
        bench_free(&b);
        row_free(&r);
    }
    geometry_free(&g);
    return failed ? err_set(e, "out of memory") : 0;
}
