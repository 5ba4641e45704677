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
#include "merge.h"
#include "placing.h"
#include "remapjob.h"

#define DEG (M_PI / 180)

/* How well a view shows direction d: 1 in the middle, 0 from 170 degrees on. */
static double shown(const chart *c, const double d[3])
{
    double cosine = c->frame[2][0] * d[0] + c->frame[2][1] * d[1] + c->frame[2][2] * d[2];
    return fmax(1 - acos(fmin(fmax(cosine, -1), 1)) / (170 * DEG), 1e-3);
}

/* The fourth power leaves what one shows in its middle to that one.  The exposure is matched where each is
 * within 94 degrees of its middle, and less the farther from there. */
static double weigh(double well[2], const chart *const charts[2], const double d[3])
{
    for (int k = 0; k < 2; k++) well[k] = pow(shown(charts[k], d), 4);
    return fmin(fmin(well[0], well[1]) / 0.04, 1);
}

static void tell(outcome *o, const settings *s, double matched)
{
    if (s->have_second_gain && s->second_gain > 0) {
        outcome_note(o, "%s: factor %.4g as given; %.4g would match over the %.2g sr that both show",
                     s->second, s->second_gain, matched, o->second_overlap);
    } else if (o->second_residual == 0 && o->second_overlap < MERGE_LEAST_OVERLAP) {
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
    const merge_views p = {{first, &src}, dst, {rgb, rgb2}, {alpha, alpha2}, weigh};
    if (!rc) rc = merge_match(o, &p, e);
    if (!rc) {
        double matched = o->second_gain;
        if (s->have_second_gain && s->second_gain > 0) o->second_gain = s->second_gain;
        tell(o, s, matched);
        merge_blend(&p, o->second_gain, 0);
    }
done:
    free(rgb2);
    free(alpha2);
    return rc;
}
