/*
 * dual.c - see dual.h.
 *
 * The first circle's lens looks ahead, as a single fisheye's does, the second's back, both upright:
 *
 *        up                         up
 *     .------.                   .------.
 *  L (  ahead ) R             R (  back  ) L        L, R: the camera's left and right
 *     '------'                   '------'
 *
 * A calibration may say more exactly how the second stands to the first (lens.h, from_first).  Beyond 90 degrees
 * both lenses show the same directions.  There each direction is taken from both, by how far it lies within their
 * fields, so that nothing jumps where a field ends:  weight = (end - angle) / end.
 */
#include "dual.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "circle.h"
#include "falloff.h"
#include "lensfile.h"
#include "merge.h"
#include "placing.h"

#define DEG (M_PI / 180)

/* Where a circle lies: the part of the picture that is looked at, whole pixels. */
typedef struct box {
    int x, y, w, h;
} box;

static box half_of(const img *im, int k)
{
    const int w = im->info.width, h = im->info.height;
    if (w >= h) return (box){k ? w - w / 2 : 0, 0, w / 2, h};
    return (box){0, k ? h - h / 2 : 0, w, h / 2};
}

/* The square round a given circle, with room for its rim's neighbours. */
static box round_circle(const img *im, const double q[3])
{
    const double w = im->info.width, h = im->info.height, r = q[2] + 2;
    const int x0 = (int)fmax(floor(q[0] - r), 0), y0 = (int)fmax(floor(q[1] - r), 0),
              x1 = (int)fmin(ceil(q[0] + r), w), y1 = (int)fmin(ceil(q[1] + r), h);
    return (box){x0, y0, x1 - x0, y1 - y0};
}

static int cut(img *out, const img *im, box b, errmsg *e)
{
    if (img_alloc(out, b.w, b.h, 4, e)) return -1;
    for (int y = 0; y < b.h; y++)
        memcpy(out->pix + 4 * (size_t)y * (size_t)b.w,
               im->pix + 4 * ((size_t)(b.y + y) * (size_t)im->info.width + (size_t)b.x),
               4 * sizeof(float) * (size_t)b.w);
    return 0;
}

/* The lens of circle k, for the picture that b cuts out. */
static int read_lens(lens *l, outcome *o, const settings *s, const img *im, int k, box b, errmsg *e)
{
    char said[512];
    const double whole[4] = {b.x, b.y, im->info.width, im->info.height};
    const int own = k && s->lens2,
              given = s->ncircles > 0; /* a given circle is in no picture's coordinates */
    const lens_use use = {.fov_deg = s->fov_deg,
                          .width = given ? 0 : b.w,
                          .height = given ? 0 : b.h,
                          .placed = given,
                          .camera = s->lens2 ? 0 : k + 1,
                          .inscribed = 1,
                          .of_whole = whole};
    if (lens_read_for(l, said, own ? s->lens2 : s->lens, &use, e)) return -1;
    if (said[0] && !strstr(o->remark, said)) outcome_note(o, "%s", said);
    return 0;
}

/* A circle's frame: its picture as stored is turned to stand upright. */
static void turn_picture(chart *c, double rotate)
{
    double right[3], up[3];
    memcpy(right, c->frame[0], sizeof right);
    memcpy(up, c->frame[1], sizeof up);
    for (int i = 0; i < 3; i++) {
        c->frame[0][i] = cos(rotate) * right[i] + sin(rotate) * up[i];
        c->frame[1][i] = cos(rotate) * up[i] - sin(rotate) * right[i];
    }
}

/* The second lens looks back: half a turn about the camera's up. */
static void look_back(chart *c)
{
    for (int i = 0; i < 3; i++) {
        c->frame[0][i] = -c->frame[0][i];
        c->frame[2][i] = -c->frame[2][i];
    }
}

/* The second lens's frame from the first's: right, down and ahead of the second are R of the first's. */
static void stand_as_stated(chart *c, const chart *first, const double R[9])
{
    for (int i = 0; i < 3; i++) {
        const double f[3] = {first->frame[0][i], -first->frame[1][i], first->frame[2][i]};
        double g[3];
        for (int k = 0; k < 3; k++) g[k] = R[3 * k] * f[0] + R[3 * k + 1] * f[1] + R[3 * k + 2] * f[2];
        c->frame[0][i] = g[0], c->frame[1][i] = -g[1], c->frame[2][i] = g[2];
    }
}

static int states_rotation(const lens *l)
{
    for (int i = 0; i < 9; i++)
        if (l->from_first[i] != 0) return 1;
    return 0;
}

/* Centre and radius of circle k in the part that b cuts out: given, from the camera matrix, found, or the largest. */
static int find_place(double q[3], const settings *s, const lens *l, const img *part, int k, box b, errmsg *e)
{
    const int matrix = l->focal_px > 0;
    circle_found f;
    errmsg why;
    if (s->ncircles) {
        q[0] = s->circle[k][0] - b.x, q[1] = s->circle[k][1] - b.y, q[2] = s->circle[k][2];
        return 0;
    }
    q[0] = matrix ? l->centre_px[0] : b.w / 2., q[1] = matrix ? l->centre_px[1] : b.h / 2.;
    q[2] = matrix ? l->focal_px / l->scale : fmin(b.w, b.h) / 2.;
    if (!s->circles_auto) return 0;
    if (circle_find(&f, part->pix, b.w, b.h, CIRCLE_LENS, matrix ? q[2] : 0, &why))
        return err_set(e, "%s: %s circle, in its half: %s (of both: --circles)", s->in,
                       k ? "second" : "first", why.text);
    q[0] = f.x, q[1] = f.y;
    if (!matrix) q[2] = f.r;
    return 0;
}

/* Circle k as a chart of the part that b cuts out of im; c[0] is there when c[1] is made.  Turned as the camera only
 * later. */
static int place(chart c[2], outcome *o, const settings *s, const img *im, const img *part, int k, box b,
                 errmsg *e)
{
    lens l;
    double q[3];
    if (read_lens(&l, o, s, im, k, b, e) || find_place(q, s, &l, part, k, b, e)) return -1;
    chart_disc(c + k, b.w, b.h, &l, q[0], q[1], q[2], 0, 0, 0, 0);
    if (k && states_rotation(&l)) {
        if (s->circle_rotate[1] != 0)
            return err_set(
                e,
                "%s: expected no turn of the second circle (--circle-rotate), since this file states how "
                "it stands to the first; found %g degrees",
                s->lens2 ? s->lens2 : s->lens, s->circle_rotate[1]);
        stand_as_stated(c + 1, c, l.from_first);
        return 0;
    }
    if (k) look_back(c + 1);
    turn_picture(c + k, s->circle_rotate[k] * DEG);
    return 0;
}

static int correct_falloff(img *im, outcome *o, const settings *s, const chart *c, double f_number, int k,
                           errmsg *e)
{
    const char *file = k && s->falloff2 ? s->falloff2 : s->falloff;
    falloff *f = malloc(sizeof *f);
    if (!f) return err_set(e, "out of memory");
    const double fn = s->aperture > 0 ? s->aperture : f_number;
    const int rc = falloff_read(f, file, c->lens.half, s->falloff_set, fn, e);
    if (!rc) falloff_apply(im->pix, 4, c, f);
    if (!rc && f->chosen[0] && (!k || s->falloff2))
        outcome_note(o, "%s: took the set %s; choose with --aperture or --falloff-set", file, f->chosen);
    free(f);
    return rc;
}

/* One circle, remapped from its part of the picture. */
static int remap_part(float *rgb, float *alpha, chart c[2], outcome *o, session *w, const settings *s,
                      const img *im, img *part, int all_good, int k, box b, const chart *dst, errmsg *e)
{
    if (place(c, o, s, im, part, k, b, e)) return -1;
    chart turned = c[k];
    turn_chart(&turned, s, 0);
    if (s->falloff && correct_falloff(part, o, s, &turned, im->info.f_number, k, e)) return -1;
    hide_nadir(part->pix, &all_good, &turned, s->circle_rotate[k] * DEG, s->nadir_deg * DEG);
    o->circles[k] = (sphere_seen){turned.cx + b.x, turned.cy + b.y, turned.radius};
    o->circle_half_deg[k] = turned.lens.half / DEG;
    return remap_picture(rgb, alpha, o, w, s, part, all_good, &turned, dst, e);
}

static int one(float *rgb, float *alpha, chart c[2], outcome *o, session *w, const settings *s, const img *im,
               int all_good, int k, const chart *dst, errmsg *e)
{
    const box b = s->ncircles ? round_circle(im, s->circle[k]) : half_of(im, k);
    img part;
    if (b.w < 2 || b.h < 2)
        return err_set(
            e, "%s: expected circles that reach into the picture (%d x %d), found centre %g,%g radius %g",
            s->in, im->info.width, im->info.height, s->circle[k][0], s->circle[k][1], s->circle[k][2]);
    if (cut(&part, im, b, e)) return -1;
    const int rc = remap_part(rgb, alpha, c, o, w, s, im, &part, all_good, k, b, dst, e);
    img_free(&part);
    return rc;
}

/* The last two pixels before the rim are what slope.h puts there: they have no say where the other shows. */
static double well_shown(const chart *c, const double d[3])
{
    const double *a = c->frame[2], cosine = a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
    double grows;
    lens_radius(&grows, &c->lens, c->lens.half);
    const double last = c->lens.half - fmin(2 / (c->radius * grows), c->lens.half / 4);
    return fmax(1 - acos(fmin(fmax(cosine, -1), 1)) / last, 1e-6);
}

/* In matching, the middle of the overlap has most to say and rims nothing. */
static double weigh(double well[2], const chart *const charts[2], const double d[3])
{
    for (int k = 0; k < 2; k++) well[k] = well_shown(charts[k], d);
    const double sum = well[0] + well[1];
    return 4 * well[0] * well[1] / (sum * sum);
}

static void tell(outcome *o, const settings *s, double matched)
{
    if (s->have_second_gain && s->second_gain > 0)
        outcome_note(
            o, "%s: second circle's factor %.4g as given; %.4g would match over the %.2g sr that both show",
            s->in, s->second_gain, matched, o->second_overlap);
    else if (o->second_residual == 0 && o->second_overlap < MERGE_LEAST_OVERLAP)
        outcome_note(o, "%s: exposures not matched, only %.2g sr are shown by both circles", s->in,
                     o->second_overlap);
    else
        outcome_note(
            o,
            "%s: second circle's light times %.4g, matched over the %.2g sr that both show, where they then "
            "differ by %.1f %%%s",
            s->in, o->second_gain, o->second_overlap, 100 * o->second_residual,
            o->second_residual > 0.25
                ? ": that is much; are --fov, --circles and --circle-rotate right, and in this order?"
                : "");
}

/* One factor serves all colours: light is not coloured anew by a guess. */
static void tell_colours(outcome *o, const settings *s)
{
    const double *c = o->second_colour;
    double worst = 0;
    for (int k = 0; k < 3; k++) worst = fmax(worst, fabs(c[k] - 1));
    if (worst > 0.03)
        outcome_note(o,
                     "%s: the circles' colours differ: the second's red, green, blue would be times %.3g, "
                     "%.3g, %.3g more (not done)",
                     s->in, c[0], c[1], c[2]);
}

/* Without --fov the fields are a choice of ours. */
static void tell_fields(outcome *o, const settings *s)
{
    if (s->fov_deg > 0) return;
    outcome_note(o, "%s: fields of view %.4g and %.4g degrees, as far as halves and lens models go (--fov)",
                 s->in, 2 * o->circle_half_deg[0], 2 * o->circle_half_deg[1]);
}

int dual_remap(float *rgb, float *alpha, outcome *o, session w[2], const settings *s, const img *im,
               int all_good, const chart *dst, errmsg *e)
{
    const size_t n = (size_t)dst->width * (size_t)dst->height;
    float *rgb2 = malloc(n * 3 * sizeof(float)), *alpha2 = malloc(n * sizeof(float));
    chart c[2];
    int rc = rgb2 && alpha2 ? 0 : err_set(e, "out of memory");
    for (int k = 0; k < 2 && !rc; k++)
        rc = one(k ? rgb2 : rgb, k ? alpha2 : alpha, c, o, w ? w + k : NULL, s, im, all_good, k, dst, e);
    for (int k = 0; k < 2 && !rc; k++) turn_chart(c + k, s, 0);
    const merge_views p = {{c, c + 1}, dst, {rgb, rgb2}, {alpha, alpha2}, weigh};
    if (!rc) rc = merge_match(o, &p, e);
    if (!rc) {
        const double matched = o->second_gain;
        if (s->have_second_gain && s->second_gain > 0) o->second_gain = s->second_gain;
        if (s->to == VIEW_LATLONG && !isnan(s->heading_deg)) say_zenith(o, s);
        tell_fields(o, s);
        tell(o, s, matched);
        tell_colours(o, s);
        merge_blend(&p, o->second_gain, 1);
    }
    free(rgb2);
    free(alpha2);
    return rc;
}
