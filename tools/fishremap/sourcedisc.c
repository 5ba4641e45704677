/*
 * sourcedisc.c - finding and averaging the diffuse source (sourcedisc.h; paper, section 4.2).
 */
#include "sourcedisc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEG (M_PI / 180)

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double median(float *v, size_t n)
{
    qsort(v, n, sizeof *v, by_value);
    return n % 2 ? (double)v[n / 2] : 0.5 * ((double)v[n / 2 - 1] + (double)v[n / 2]);
}

/* Mean of what lies within 3 robust standard deviations of the median; sd of that mean, relative. */
static double robust_mean(double *sd, float *v, size_t n)
{
    double m = median(v, n), sum = 0, sq = 0;
    size_t k = 0;
    float *dev = malloc(n * sizeof *dev);
    double spread = INFINITY;
    if (dev) {
        for (size_t i = 0; i < n; i++) dev[i] = (float)fabs((double)v[i] - m);
        spread = fmax(3 * 1.4826 * median(dev, n), 1e-6 * fabs(m));
        free(dev);
    }
    for (size_t i = 0; i < n; i++)
        if (fabs((double)v[i] - m) <= spread) sum += v[i], sq += (double)v[i] * (double)v[i], k++;
    double mean = sum / (double)k, var = fmax(sq / (double)k - mean * mean, 0);
    *sd = mean > 0 ? sqrt(var / (double)k) / mean : 0;
    return mean;
}

static float brightness(const float *p)
{
    float s = p[0] + p[1] + p[2];
    return p[3] >= 0.5f && s - s == 0 ? s : 0;
}

/* Median of 3x3: one hot pixel is no source. */
static float smoothed(const float *b, int w, int h, int x, int y)
{
    float v[9];
    size_t n = 0;
    for (int j = y > 0 ? y - 1 : 0; j <= y + 1 && j < h; j++)
        for (int i = x > 0 ? x - 1 : 0; i <= x + 1 && i < w; i++)
            v[n++] = b[(size_t)j * (size_t)w + (size_t)i];
    qsort(v, n, sizeof *v, by_value);
    return v[n / 2];
}

/* Pixels above level that hang together with the seed: marked 1; their number. */
static size_t flood(unsigned char *mark, size_t *stack, const float *b, int w, int h, size_t seed,
                    float level)
{
    size_t top = 0, count = 0, n = (size_t)w * (size_t)h;
    stack[top++] = seed;
    mark[seed] = 1;
    while (top) {
        size_t at = stack[--top], x = at % (size_t)w;
        count++;
        size_t next[4] = {x ? at - 1 : n, x + 1 < (size_t)w ? at + 1 : n,
                          at >= (size_t)w ? at - (size_t)w : n, at + (size_t)w};
        for (int k = 0; k < 4; k++)
            if (next[k] < n && !mark[next[k]] && b[next[k]] > level)
                mark[next[k]] = 1, stack[top++] = next[k];
    }
    return count;
}

/* Take away the border of the marked patch, `steps` pixels deep. */
static void erode(unsigned char *mark, unsigned char *copy, int w, int h, int steps)
{
    for (int s = 0; s < steps; s++) {
        memcpy(copy, mark, (size_t)w * (size_t)h);
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                size_t at = (size_t)y * (size_t)w + (size_t)x;
                if (copy[at] && (x == 0 || y == 0 || x == w - 1 || y == h - 1 || !copy[at - 1] ||
                                 !copy[at + 1] || !copy[at - (size_t)w] || !copy[at + (size_t)w]))
                    mark[at] = 0;
            }
    }
}

static int measure(source_disc *s, const float *pix, const chart *c, const unsigned char *mark, errmsg *e)
{
    size_t n = (size_t)c->width * (size_t)c->height, k = 0;
    float *v = malloc(n * 3 * sizeof *v);
    if (!v) return err_set(e, "out of memory");
    memset(s, 0, sizeof *s);
    double sum = 0, square = 0;
    for (size_t i = 0; i < n; i++) {
        if (!mark[i]) continue;
        double qx, qy;
        chart_disc_place(&qx, &qy, c, (double)(i % (size_t)c->width) + 0.5,
                         (double)(i / (size_t)c->width) + 0.5);
        double t = lens_angle(&c->lens, hypot(qx, qy));
        sum += t, square += t * t;
        s->x += (double)(i % (size_t)c->width) + 0.5, s->y += (double)(i / (size_t)c->width) + 0.5;
        for (int ch = 0; ch < 3; ch++) v[(size_t)ch * n + k] = pix[4 * i + (size_t)ch];
        k++;
    }
    s->pixels = (int)k;
    s->x /= (double)k, s->y /= (double)k;
    double px, py;
    chart_disc_place(&px, &py, c, s->x, s->y);
    s->theta = lens_angle(&c->lens, hypot(px, py));
    s->mean_theta = sum / (double)k;
    s->spread = sqrt(fmax(square / (double)k - s->mean_theta * s->mean_theta, 0));
    for (int ch = 0; ch < 3; ch++) {
        const float *q = v + (size_t)ch * n;
        float top = q[0];
        size_t same = 0;
        for (size_t i = 0; i < k; i++) top = fmaxf(top, q[i]);
        for (size_t i = 0; i < k; i++) same += q[i] == top;
        s->top[ch] = top, s->at_top[ch] = (double)same / (double)k;
    }
    for (int ch = 0; ch < 3; ch++) s->value[ch] = robust_mean(&s->sd[ch], v + (size_t)ch * n, k);
    free(v);
    return 0;
}

int source_find(source_disc *s, const float *pix, const chart *c, double theta, errmsg *e)
{
    int w = c->width, h = c->height, rc = -1;
    size_t n = (size_t)w * (size_t)h, seed = n;
    float *b = malloc(n * sizeof *b), peak = 0;
    unsigned char *mark = calloc(n, 1), *copy = malloc(n);
    size_t *stack = malloc(n * sizeof *stack);
    if (!b || !mark || !copy || !stack) {
        err_set(e, "out of memory");
        goto done;
    }
    for (size_t i = 0; i < n; i++) b[i] = brightness(pix + 4 * i);
    double r0 = lens_radius(NULL, &c->lens, theta - 12 * DEG) - 1 / c->radius;
    double r1 = lens_radius(NULL, &c->lens, theta + 12 * DEG) + 1 / c->radius;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            double px, py;
            chart_disc_place(&px, &py, c, x + 0.5, y + 0.5);
            double r = hypot(px, py);
            if (r < r0 || r > r1) continue;
            float v = smoothed(b, w, h, x, y);
            if (v > peak) peak = v, seed = (size_t)y * (size_t)w + (size_t)x;
        }
    if (seed == n) {
        err_set(e, "expected a bright source at %.4g degrees, found nothing but black there", theta / DEG);
        goto done;
    }
    b[seed] = fmaxf(b[seed], peak);
    size_t count = flood(mark, stack, b, w, h, seed, peak / 2);
    double radius = sqrt((double)count / M_PI);
    int border = (int)(0.12 * radius + 0.5);
    if (radius > 3 && border < 1) border = 1;
    memcpy(copy, mark, n);
    unsigned char *kept = malloc(n);
    if (!kept) {
        err_set(e, "out of memory");
        goto done;
    }
    memcpy(kept, mark, n);
    erode(mark, copy, w, h, border);
    size_t left = 0;
    for (size_t i = 0; i < n; i++) left += mark[i];
    if (left < 5) memcpy(mark, kept, n); /* a patch too thin to lose a border */
    free(kept);
    rc = measure(s, pix, c, mark, e);
done:
    free(b);
    free(mark);
    free(copy);
    free(stack);
    return rc;
}

int flat_clipped(double top[3], const float *pix, const chart *c, double white, errmsg *e)
{
    size_t total = (size_t)c->width * (size_t)c->height, n = 0;
    float *v = malloc(total * sizeof *v);
    if (!v) return err_set(e, "out of memory");
    for (int ch = 0; ch < 3; ch++) {
        n = 0;
        for (size_t i = 0; i < total; i++) {
            double x, y;
            chart_disc_place(&x, &y, c, (double)(i % (size_t)c->width) + 0.5,
                             (double)(i / (size_t)c->width) + 0.5);
            if (hypot(x, y) < 1 && brightness(pix + 4 * i) > 0) v[n++] = pix[4 * i + (size_t)ch];
        }
        qsort(v, n, sizeof *v, by_value);
        size_t same = 0, near = 0, values = 0;
        for (size_t i = n; i-- > 0 && v[i] == v[n - 1];) same++;
        for (size_t i = n - same; i-- > 0 && (double)v[i] > 0.96 * (double)v[n - 1]; near++)
            values += i + 1 == n - same || v[i] != v[i + 1];
        /* the top of a smooth field is a hump: its last value is taken by few times as many pixels as those
         * just below; of noise by fewer */
        int full =
            white > 0 && n && (double)v[n - 1] >= white * (1 - 1e-6) && (double)same > 0.002 * (double)n;
        int piled = (double)same > 0.02 * (double)n &&
                    (double)same > 6 * (double)near / (double)(values ? values : 1) &&
                    (white > 0 ? (double)v[n - 1] > 0.75 * white : values > 0);
        top[ch] = full || piled ? (double)v[n - 1] : 0;
    }
    free(v);
    return 0;
}

int flat_rings(falloff_reading *r, int *n, int max, const float *pix, const chart *c, errmsg *e)
{
    int rings = max, found = 0;
    int most = (int)(c->radius / 2);
    if (rings > most) rings = most;
    if (rings < 4)
        return err_set(e, "expected an image circle of at least 8 pixels radius, found %g", c->radius);
    size_t total = (size_t)c->width * (size_t)c->height;
    size_t *count = calloc((size_t)rings + 1, sizeof *count);
    float *v = malloc(total * 3 * sizeof *v);
    int *ring = malloc(total * sizeof *ring);
    if (!count || !v || !ring) {
        free(count);
        free(v);
        free(ring);
        return err_set(e, "out of memory");
    }
    for (size_t i = 0; i < total; i++) {
        double x, y;
        chart_disc_place(&x, &y, c, (double)(i % (size_t)c->width) + 0.5,
                         (double)(i / (size_t)c->width) + 0.5);
        double q = hypot(x, y); /* pixels wholly inside */
        int in = q + M_SQRT1_2 / c->radius < 1 && brightness(pix + 4 * i) > 0;
        ring[i] = in ? (int)(lens_angle(&c->lens, q) / c->lens.half * rings) : -1;
        if (ring[i] >= rings) ring[i] = -1;
        if (ring[i] >= 0) count[ring[i] + 1]++;
    }
    for (int k = 0; k < rings; k++) count[k + 1] += count[k];
    size_t *fill = malloc(sizeof *fill * (size_t)rings);
    if (fill) {
        memcpy(fill, count, sizeof *fill * (size_t)rings);
        for (size_t i = 0; i < total; i++) {
            if (ring[i] < 0) continue;
            size_t at = fill[ring[i]]++;
            for (int ch = 0; ch < 3; ch++) v[(size_t)ch * total + at] = pix[4 * i + (size_t)ch];
        }
        for (int k = 0; k < rings; k++) {
            size_t have = count[k + 1] - count[k];
            if (have < 3) continue;
            falloff_reading *q = r + found++;
            memset(q, 0, sizeof *q);
            q->theta = (k + 0.5) / rings * c->lens.half;
            q->spread = c->lens.half / rings / sqrt(12);
            for (int ch = 0; ch < 3; ch++)
                q->y[ch] = robust_mean(&q->sd[ch], v + (size_t)ch * total + count[k], have);
        }
    }
    free(fill);
    free(count);
    free(v);
    free(ring);
    *n = found;
    return found < 2 ? err_set(e, "expected a flat field with light in at least 2 rings, found %d", found)
                     : 0;
}
