/*
 * picture.c - the job of remapping one picture: load, correct the falloff, remap, write.
 */
#include "picture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dual.h"
#include "falloff.h"
#include "input.h"
#include "overlay.h"
#include "placing.h"
#include "result.h"
#include "second.h"
#include "view.h"

#define DEG (M_PI / 180)

/* Shares of the output's solid angle that are covered; whether any texel is not wholly. */
static double coverage(int *partial, const float *alpha, const chart *dst)
{
    double seen = 0, all = 0;
    *partial = 0;
    for (int y = 0; y < dst->height; y++)
        for (int x = 0; x < dst->width; x++) {
            float a = alpha[(size_t)y * (size_t)dst->width + (size_t)x];
            double w = chart_pixel_solid_angle(dst, x, y);
            *partial |= a < 1;
            seen += w * (double)a, all += w;
        }
    return all > 0 ? seen / all : 0;
}

static int is_hdr(const char *name)
{
    const char *dot = strrchr(name, '.');
    return strcmp(name, "-") == 0 || (dot && strcmp(dot, ".hdr") == 0);
}

/* The falloff that --falloff names, taken out. */
static int correct_falloff(img *im, outcome *o, const settings *s, const chart *src, errmsg *e)
{
    falloff *f = malloc(sizeof *f);
    double fn = s->aperture > 0 ? s->aperture : im->info.f_number;
    int failed = !f || falloff_read(f, s->falloff, src->lens.half, s->falloff_set, fn, e);
    if (!failed) falloff_apply(im->pix, 4, src, f);
    if (!failed && f->chosen[0])
        outcome_note(o, "%s: took the set %s; choose with --aperture or --falloff-set", s->falloff,
                     f->chosen);
    free(f);
    return failed ? -1 : 0;
}

/* A picture with one chart: of a fisheye, a ball (or two of one), a map. */
static int remap_one(float *rgb, float *alpha, outcome *o, session *w, const settings *s, img *im,
                     int all_good, const chart *dst, errmsg *e)
{
    chart src;
    if (place_chart(&src, o, s, s->from, im, e)) return -1;
    if (s->overlay) {
        sphere_seen rim = {src.cx, src.cy, src.radius};
        if (overlay_write(s->overlay, im, &rim, src.kind == CHART_DISC, e)) return -1;
    }
    if (s->falloff && correct_falloff(im, o, s, &src, e)) return -1;
    if (s->from == VIEW_BALL) hide_camera(im->pix, &all_good, &src, s->hide_camera_deg * DEG);
    hide_nadir(im->pix, &all_good, &src, 0, s->nadir_deg * DEG);
    o->cx = src.cx, o->cy = src.cy, o->radius = src.radius;
    if (remap_picture(rgb, alpha, o, w, s, im, all_good, &src, dst, e)) return -1;
    return s->second ? second_add(rgb, alpha, o, s, &src, dst, e) : 0;
}

static int remap_two(float *rgb, float *alpha, outcome *o, session *w, const settings *s, img *im,
                     int all_good, const chart *dst, errmsg *e)
{
    if (dual_remap(rgb, alpha, o, w, s, im, all_good, dst, e)) return -1;
    return s->overlay ? overlay_write(s->overlay, im, o->circles, 2, e) : 0;
}

/* Remarks on what was made, and the file. */
static int finish(outcome *o, const settings *s, float *rgb, float *alpha, const chart *dst, errmsg *e)
{
    char view[256];
    int partial;
    o->covered = coverage(&partial, alpha, dst);
    if (o->covered == 0)
        return err_set(e, "%s: expected some of the picture to fall into the output, found none", s->in);
    outside_fill(rgb, alpha, s->out_w, s->out_h, s->outside);
    const int hdr = is_hdr(s->out), named = hdr && radiance_view(view, sizeof view, dst, s->to) == 0;
    if (hdr && view_is_disc(s->to) && !named)
        outcome_note(o, "%s: Radiance has no name for this view, so there is no VIEW line", s->out);
    if (hdr && o->covered < 0.9995 && s->outside != OUTSIDE_HOLD)
        outcome_note(o, "%s: %.1f %% of what it shows is not in IN, and black: no alpha channel in .hdr",
                     s->out, 100 * (1 - o->covered));
    return result_write(s, rgb, alpha, partial, named ? view : NULL, dst, e);
}

int job_picture(outcome *o, session w[2], const settings *s, errmsg *e)
{
    img im;
    chart dst;
    int rc = -1, all_good;
    float *rgb = NULL, *alpha = NULL;
    if (input_load(&im, &all_good, s, e)) return -1;
    if (place_chart(&dst, o, s, s->to, NULL, e)) goto done;
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    rgb = malloc(n * 3 * sizeof(float)), alpha = malloc(n * sizeof(float));
    if (!rgb || !alpha) {
        err_set(e, "out of memory");
        goto done;
    }
    if ((s->dual ? remap_two : remap_one)(rgb, alpha, o, w, s, &im, all_good, &dst, e)) goto done;
    for (size_t i = 0; s->from == VIEW_BALL && i < 3 * n; i++)
        rgb[i] = (float)(rgb[i] / s->reflectance[i % 3]);
    rc = finish(o, s, rgb, alpha, &dst, e);
done:
    free(rgb);
    free(alpha);
    img_free(&im);
    return rc;
}
