/*
 * remap.c - remap of one picture, weights made and used row by row (remap.h).
 */
#include "remap.h"

#include <stdlib.h>
#include <string.h>

#include "weights.h"

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
                const float *q = s->slopes + (size_t)e->px * SRC_FLOATS;
                sum += e->w * *(const v4 *)q + e->wx * *(const v4 *)(q + 3) + e->wy * *(const v4 *)(q + 6);
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
    geometry_free(&g);
    return failed ? err_set(e, "out of memory") : 0;
}
