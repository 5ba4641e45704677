/*
 * slope.c - limited slopes, bad pixels and the rim (slope.h).
 */
#include "slope.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Copy as RGB into the value slots; mark what can't be used. */
static int64_t take_values(float *px, unsigned char *bad, const float *pix, size_t n, int channels,
                           const unsigned char *mask)
{
    int64_t nbad = 0;
    int colours = channels >= 3 ? 3 : 1, alpha = channels == 2 || channels == 4;
#pragma omp parallel for schedule(static) reduction(+ : nbad)
    for (size_t i = 0; i < n; i++) {
        const float *q = pix + i * (size_t)channels;
        float *p = px + i * SRC_FLOATS;
        float r = q[0], g = colours == 3 ? q[1] : r, b = colours == 3 ? q[2] : r;
        float all = r + g + b;
        int is_bad = !(all - all == 0) || (alpha && !(q[channels - 1] >= 0.5f)) || (mask && mask[i]);
        bad[i] = (unsigned char)is_bad;
        nbad += is_bad;
        p[0] = is_bad ? 0 : r, p[1] = is_bad ? 0 : g, p[2] = is_bad ? 0 : b;
    }
    return nbad;
}

/* Pixels cut by the circle: the value of the nearest pixel inwards that lies wholly inside. */
static void hold_rim(float *px, unsigned char *bad, const chart *c)
{
    int w = c->width, h = c->height;
    double outer = c->radius + M_SQRT1_2, inner = c->radius - M_SQRT1_2;
    if (inner < 1) return;
#pragma omp parallel for schedule(dynamic, 16)
    for (int y = 0; y < h; y++) {
        double dy = y + 0.5 - c->cy;
        if (fabs(dy) > outer) continue;
        /* the two stretches of this row between the inner and the outer circle */
        double xo = sqrt(fmax(outer * outer - dy * dy, 0)), xi = fabs(dy) < inner ? sqrt(inner * inner - dy * dy) : 0;
        for (int side = 0; side < 2; side++) {
            double from = side ? c->cx + xi - 1 : c->cx - xo - 1, to = side ? c->cx + xo + 1 : c->cx - xi + 1;
            int x0 = from < 0 ? 0 : from > w ? w : (int)from, x1 = to < 0 ? 0 : to > w ? w : (int)to;
            for (int x = x0; x < x1; x++) {
                double dx = x + 0.5 - c->cx, r = hypot(dx, dy);
                /* farthest corner */
                double far = hypot(fabs(dx) + 0.5, fabs(dy) + 0.5);
                if (far <= c->radius || r > outer) continue;
                for (double back = 0.5; back < 3; back += 0.5) {
                    double k = (r - back) / r;
                    int xs = (int)floor(c->cx + dx * k), ys = (int)floor(c->cy + dy * k);
                    if (xs < 0 || ys < 0 || xs >= w || ys >= h) break;
                    if (hypot(fabs(xs + 0.5 - c->cx) + 0.5, fabs(ys + 0.5 - c->cy) + 0.5) > c->radius) continue;
                    size_t from_px = (size_t)ys * (size_t)w + (size_t)xs, to_px = (size_t)y * (size_t)w + (size_t)x;
                    memcpy(px + to_px * SRC_FLOATS, px + from_px * SRC_FLOATS, 3 * sizeof(float));
                    bad[to_px] = bad[from_px];
                    break;
                }
            }
        }
    }
}

static inline float limited(float a, float b)
{
    /* a, b: differences to the left and to the right */
    float c = 0.5f * (a + b), m = 2 * fminf(fabsf(a), fabsf(b));
    float s = fminf(fabsf(c), m);
    return a * b > 0 ? copysignf(s, c) : 0;
}

/* Slopes of one row. */
static void slope_row(remap_source *s, int y, int wrap)
{
    int w = s->width, h = s->height;
    size_t row = (size_t)y * (size_t)w;
    const unsigned char *bad = s->bad;
    for (int x = 0; x < w; x++) {
        float *p = s->px + (row + (size_t)x) * SRC_FLOATS;
        int xl = x > 0 ? x - 1 : wrap ? w - 1 : x, xr = x + 1 < w ? x + 1 : wrap ? 0 : x;
        int yu = y > 0 ? y - 1 : y, yd = y + 1 < h ? y + 1 : y;
        size_t l = row + (size_t)xl, r = row + (size_t)xr;
        size_t u = (size_t)yu * (size_t)w + (size_t)x, d = (size_t)yd * (size_t)w + (size_t)x;
        int use_x = !(bad[l] | bad[r]), use_y = !(bad[u] | bad[d]);
        const float *pl = s->px + l * SRC_FLOATS, *pr = s->px + r * SRC_FLOATS;
        const float *pu = s->px + u * SRC_FLOATS, *pd = s->px + d * SRC_FLOATS;
        for (int c = 0; c < 3; c++) {
            float gx = use_x ? limited(p[c] - pl[c], pr[c] - p[c]) : 0;
            float gy = use_y ? limited(p[c] - pu[c], pd[c] - p[c]) : 0;
            /* lowest corner >= 0 */
            float dip = 0.5f * (fabsf(gx) + fabsf(gy));
            if (dip > p[c]) {
                float k = p[c] > 0 ? p[c] / dip : 0;
                gx *= k, gy *= k;
            }
            p[3 + c] = gx, p[6 + c] = gy;
        }
    }
}

int source_prepare(remap_source *s, const float *pix, int width, int height, int channels,
                   const unsigned char *mask, const chart *src, errmsg *e)
{
    size_t n = (size_t)width * (size_t)height;
    remap_source t = {width, height, malloc((n * SRC_FLOATS + 4) * sizeof(float)), malloc(n), 0};
    if (!t.px || !t.bad) {
        source_free(&t);
        return err_set(e, "out of memory");
    }
    memset(t.px + n * SRC_FLOATS, 0, 4 * sizeof(float));
    t.nbad = take_values(t.px, t.bad, pix, n, channels, mask);
    if (src->kind == CHART_DISC) hold_rim(t.px, t.bad, src);
    int wrap = src->kind == CHART_GRID && src->lon_span > 2 * M_PI * (1 - 1e-12);
#pragma omp parallel for schedule(static)
    for (int y = 0; y < height; y++) slope_row(&t, y, wrap);
    if (!t.nbad) {
        free(t.bad);
        t.bad = NULL;
    }
    *s = t;
    return 0;
}

void source_free(remap_source *s)
{
    free(s->px);
    free(s->bad);
    memset(s, 0, sizeof *s);
}
