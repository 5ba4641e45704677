/* merge.c - see merge.h. */
#include "merge.h"

#include <math.h>
#include <stdlib.h>

typedef struct sample {
    double v, w;
} sample;

static int by_value(const void *a, const void *b)
{
    double x = ((const sample *)a)->v, y = ((const sample *)b)->v;
    return (x > y) - (x < y);
}

static double weighted_median(sample *q, size_t n)
{
    double all = 0, sum = 0;
    qsort(q, n, sizeof *q, by_value);
    for (size_t i = 0; i < n; i++) all += q[i].w;
    for (size_t i = 0; i < n; i++) {
        sum += q[i].w;
        if (2 * sum >= all) return q[i].v;
    }
    return 0;
}

static double weigh(double well[2], const merge_views *p, size_t i)
{
    double d[3], w = p->dst->width;
    double row = floor((double)i / w);
    chart_unproject(d, p->dst, (double)i - row * w + 0.5, row + 0.5);
    return p->weigh(well, p->chart, d);
}

/* One texel's ratio of light, logarithm, and its weight; 0 where it has no say. */
static int ratio(sample *out, const merge_views *p, size_t i)
{
    double well[2], sum[2] = {0, 0};
    if (p->alpha[0][i] < 0.9f || p->alpha[1][i] < 0.9f) return 0;
    for (int v = 0; v < 2; v++)
        for (size_t c = 0; c < 3; c++) sum[v] += (double)p->rgb[v][3 * i + c];
    const size_t w = (size_t)p->dst->width;
    const double angle = chart_pixel_solid_angle(p->dst, (int)(i % w), (int)(i / w));
    if (!(angle > 0) || !(sum[0] > 0) || !(sum[1] > 0)) return 0;
    *out = (sample){log(sum[0] / sum[1]), angle * weigh(well, p, i)};
    return 1;
}

/* The median ratio of one colour, over what has a say. */
static double colour_ratio(sample *q, const merge_views *p, const size_t *at, const double *say, size_t n,
                           int c)
{
    size_t k = 0;
    for (size_t i = 0; i < n; i++) {
        const float a = p->rgb[0][3 * at[i] + (size_t)c], b = p->rgb[1][3 * at[i] + (size_t)c];
        if (a > 0 && b > 0) q[k++] = (sample){log((double)a / (double)b), say[i]};
    }
    return k ? exp(weighted_median(q, k)) : NAN;
}

/* The factor, what is left, and the colours, from k samples at texels at[]. */
static void settle(outcome *o, sample *q, double *say, const size_t *at, size_t k, const merge_views *p)
{
    for (size_t i = 0; i < k; i++) say[i] = q[i].w;
    const double middle = weighted_median(q, k);
    for (size_t i = 0; i < k; i++) q[i].v = fabs(q[i].v - middle);
    o->second_gain = exp(middle);
    o->second_residual = 1.4826 * weighted_median(q, k);
    for (int c = 0; c < 3; c++) o->second_colour[c] = colour_ratio(q, p, at, say, k, c) / o->second_gain;
}

int merge_match(outcome *o, const merge_views *p, errmsg *e)
{
    size_t n = (size_t)p->dst->width * (size_t)p->dst->height, k = 0;
    sample *q = malloc(n * sizeof *q);
    size_t *at = malloc(n * sizeof *at);
    double *say = malloc(n * sizeof *say);
    const int bad = !q || !at || !say;
    o->second_gain = 1, o->second_residual = o->second_overlap = 0;
    for (int c = 0; c < 3; c++) o->second_colour[c] = 1;
    for (size_t i = 0; !bad && i < n; i++)
        if (ratio(q + k, p, i)) o->second_overlap += q[k].w, at[k++] = i;
    if (!bad && o->second_overlap >= MERGE_LEAST_OVERLAP && k >= 16) settle(o, q, say, at, k, p);
    free(q);
    free(at);
    free(say);
    return bad ? err_set(e, "out of memory") : 0;
}

/* Texel i from both: by how well they show its direction, and how much of it. */
static void blend_texel(const merge_views *p, size_t i, double gain)
{
    double weight[2] = {1, 1};
    float *to = p->rgb[0] + 3 * i;
    const float *from = p->rgb[1] + 3 * i;
    if (p->alpha[0][i] > 0 && p->alpha[1][i] > 0) weigh(weight, p, i);
    for (int k = 0; k < 2; k++) weight[k] *= (double)p->alpha[k][i];
    double sum = weight[0] + weight[1];
    for (int k = 0; sum > 0 && k < 3; k++)
        to[k] = (float)((weight[0] * (double)to[k] + weight[1] * gain * (double)from[k]) / sum);
}

void merge_blend(const merge_views *p, double gain, int apart)
{
    size_t n = (size_t)p->dst->width * (size_t)p->dst->height;
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < n; i++) {
        float *a = p->alpha[0] + i, b = p->alpha[1][i];
        blend_texel(p, i, gain);
        *a = apart ? fminf(*a + b, 1) : fmaxf(*a, b);
    }
}
