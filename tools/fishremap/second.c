/*
 * second.c - a second view of the same mirror ball, from elsewhere, added to the first.
 *
 * A ball shows all directions, but those behind it in a rim of a few pixels, and its own photographer in the
 * middle.  Each direction is taken from both views by how well they show it, best near the middle of their
 * pictures and not at all towards the rim's last degrees.  The second picture's exposure is matched first:
 * the factor is the median ratio over the directions that both show well, weighted with solid angle, so that
 * what moved or shines at one side alone has no say.
 */
#include "second.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "image/image.h"
#include "input.h"
#include "placing.h"
#include "remapjob.h"

#define DEG           (M_PI / 180)
#define LEAST_OVERLAP 0.05 /* sr, about 14 degrees across: below, no exposure is told from it */

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

/* How well a view shows direction d: 1 in the middle, 0 from 170 degrees on. */
static double shown(const chart *c, const double d[3])
{
    double cosine = c->frame[2][0] * d[0] + c->frame[2][1] * d[1] + c->frame[2][2] * d[2];
    return fmax(1 - acos(fmin(fmax(cosine, -1), 1)) / (170 * DEG), 1e-3);
}

typedef struct views {
    const chart *chart[2], *dst;
    float *rgb[2], *alpha[2];
} views;

/* How well each view shows texel i: the fourth power leaves what one shows in its middle to that one. */
static void weigh(double well[2], const views *p, size_t i)
{
    double d[3], w = p->dst->width;
    double row = floor((double)i / w);
    chart_unproject(d, p->dst, (double)i - row * w + 0.5, row + 0.5);
    for (int k = 0; k < 2; k++) well[k] = pow(shown(p->chart[k], d), 4);
}

/* The second view's factor, robust residual and overlap. */
static int match(outcome *o, const views *p, errmsg *e)
{
    size_t n = (size_t)p->dst->width * (size_t)p->dst->height, k = 0;
    sample *q = malloc(n * sizeof *q);
    if (!q) return err_set(e, "out of memory");
    o->second_gain = 1, o->second_residual = o->second_overlap = 0;
    for (size_t i = 0; i < n; i++) {
        if (p->alpha[0][i] < 0.9f || p->alpha[1][i] < 0.9f) continue;
        double well[2], sum[2] = {0, 0},
                        omega = chart_pixel_solid_angle(p->dst, (int)(i % (size_t)p->dst->width),
                                                        (int)(i / (size_t)p->dst->width));
        for (int v = 0; v < 2; v++)
            for (size_t c = 0; c < 3; c++) sum[v] += (double)p->rgb[v][3 * i + c];
        if (!(omega > 0) || !(sum[0] > 0) || !(sum[1] > 0)) continue;
        weigh(well, p, i);
        double both = fmin(well[0], well[1]) / 0.04; /* 1 where each is within 94 degrees of its middle */
        o->second_overlap += omega * fmin(both, 1);
        q[k++] = (sample){log(sum[0] / sum[1]), omega * fmin(both, 1)};
    }
    if (o->second_overlap >= LEAST_OVERLAP && k >= 16) {
        double middle = weighted_median(q, k);
        for (size_t i = 0; i < k; i++) q[i].v = fabs(q[i].v - middle);
        o->second_gain = exp(middle);
        o->second_residual = 1.4826 * weighted_median(q, k);
    }
    free(q);
    return 0;
}

static void tell(outcome *o, const settings *s, double matched)
{
    if (s->have_second_gain && s->second_gain > 0) {
        outcome_note(o, "%s: factor %.4g as given; %.4g would match over the %.2g sr that both show",
                     s->second, s->second_gain, matched, o->second_overlap);
    } else if (o->second_residual == 0 && o->second_overlap < LEAST_OVERLAP) {
        outcome_note(o, "%s: exposure not matched, only %.2g sr are shown well by both pictures", s->second,
                     o->second_overlap);
    } else {
        outcome_note(
            o,
            "%s: light times %.4g, matched over the %.2g sr that both show, where they then differ by "
            "%.1f %%%s",
            s->second, o->second_gain, o->second_overlap, 100 * o->second_residual,
            o->second_residual > 0.25 ? ": that is much; is its place in --second-view right?" : "");
    }
}

static void blend(const views *p, double gain)
{
    size_t n = (size_t)p->dst->width * (size_t)p->dst->height;
    for (size_t i = 0; i < n; i++) {
        double weight[2];
        weigh(weight, p, i);
        for (int k = 0; k < 2; k++) weight[k] *= (double)p->alpha[k][i];
        double sum = weight[0] + weight[1];
        for (size_t k = 0; sum > 0 && k < 3; k++)
            p->rgb[0][3 * i + k] = (float)((weight[0] * (double)p->rgb[0][3 * i + k] +
                                            weight[1] * gain * (double)p->rgb[1][3 * i + k]) /
                                           sum);
        p->alpha[0][i] = fmaxf(p->alpha[0][i], p->alpha[1][i]);
    }
}

int second_add(float *rgb, float *alpha, outcome *o, const settings *s, const chart *first, const chart *dst,
               errmsg *e)
{
    settings t = *s;
    img im;
    chart src;
    const double *view = s->second_view;
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    float *rgb2 = malloc(n * 3 * sizeof(float)), *alpha2 = malloc(n * sizeof(float));
    int rc = -1, all_good;
    t.in = s->second, t.mask = s->second_mask;
    t.tilt_deg = view[3], t.tilt_to_deg = view[4];
    if (s->second_rotates) t.rotate_deg = view[5];
    if (!rgb2 || !alpha2) {
        err_set(e, "out of memory");
        goto done;
    }
    if (input_load(&im, &all_good, &t, e)) goto done;
    double dx = fmax(fmax(-view[0], view[0] - im.info.width), 0),
           dy = fmax(fmax(-view[1], view[1] - im.info.height), 0);
    if (hypot(dx, dy) >= view[2]) {
        err_set(e, "%s: expected the ball to reach into the picture (%d x %d), found X,Y,R %g,%g,%g",
                s->second, im.info.width, im.info.height, view[0], view[1], view[2]);
        img_free(&im);
        goto done;
    }
    chart_disc(&src, im.info.width, im.info.height, &first->lens, view[0], view[1], view[2], 1, 0, 0, 0);
    turn_chart(&src, &t, 1);
    hide_camera(im.pix, &all_good, &src, s->hide_camera_deg * DEG);
    rc = remap_picture(rgb2, alpha2, o, NULL, &t, &im, all_good, &src, dst, e);
    img_free(&im);
    const views p = {{first, &src}, dst, {rgb, rgb2}, {alpha, alpha2}};
    if (!rc) rc = match(o, &p, e);
    if (!rc) {
        double matched = o->second_gain;
        if (s->have_second_gain && s->second_gain > 0) o->second_gain = s->second_gain;
        tell(o, s, matched);
        blend(&p, o->second_gain);
    }
done:
    free(rgb2);
    free(alpha2);
    return rc;
}
