/*
 * picture.c - the job of remapping one picture: load, correct the falloff, remap, write.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "circle.h"
#include "falloff.h"
#include "filter.h"
#include "lensfile.h"
#include "overlay.h"
#include "remap.h"
#include "settings.h"
#include "slope.h"

#define DEG (M_PI / 180)

static double clock_seconds(clockid_t which)
{
    struct timespec t;
    clock_gettime(which, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double cpu_seconds(void)
{
    return clock_seconds(CLOCK_PROCESS_CPUTIME_ID);
}

double cpu_thread_seconds(void)
{
    return clock_seconds(CLOCK_THREAD_CPUTIME_ID);
}

void outcome_note(outcome *o, const char *fmt, ...)
{
    va_list ap;
    size_t n = strlen(o->remark);
    if (n && n + 2 < sizeof o->remark) n += (size_t)snprintf(o->remark + n, sizeof o->remark - n, "; ");
    va_start(ap, fmt);
    vsnprintf(o->remark + n, sizeof o->remark - n, fmt, ap);
    va_end(ap);
}

/* Mask: white (over half of its scale) keeps, black discards. */
static int fold_mask(img *im, const char *path, errmsg *e)
{
    img m;
    if (img_load(&m, path, e)) return -1;
    if (m.info.width != im->info.width || m.info.height != im->info.height) {
        int w = m.info.width, h = m.info.height;
        img_free(&m);
        return err_set(e, "%s: expected a mask of %d x %d pixels, as the picture, found %d x %d", path,
                       im->info.width, im->info.height, w, h);
    }
    float level = (float)(m.info.coded ? m.info.max_code / 2 : 0.5);
    size_t n = (size_t)m.info.width * (size_t)m.info.height;
    for (size_t i = 0; i < n; i++)
        if (!(m.pix[i * (size_t)m.info.channels] >= level)) im->pix[4 * i + 3] = 0;
    img_free(&m);
    return 0;
}

int input_load(img *im, int *all_good, const settings *s, errmsg *e)
{
    img a, b;
    const img_open_opts how = {.layer = s->layer};
    if (img_load_as(&a, s->in, &how, e)) return -1;
    img_linearise_srgb(&a);
    if (img_alloc(&b, a.info.width, a.info.height, 4, e)) {
        img_free(&a);
        return -1;
    }
    b.info.f_number = a.info.f_number, b.info.exposure_s = a.info.exposure_s, b.info.iso = a.info.iso;
    int ch = a.info.channels;
    size_t n = (size_t)a.info.width * (size_t)a.info.height;
    /* alpha of a coded picture is a code; of a radiometric one a share */
    float alpha_scale = a.info.coded && a.info.max_code > 0 ? (float)(1 / a.info.max_code) : 1;
    int bad = s->mask != NULL;
#pragma omp parallel for schedule(static) reduction(| : bad)
    for (size_t i = 0; i < n; i++) {
        const float *p = a.pix + i * (size_t)ch;
        float *q = b.pix + 4 * i;
        q[0] = p[0], q[1] = ch >= 3 ? p[1] : p[0], q[2] = ch >= 3 ? p[2] : p[0];
        q[3] = ch == 2 || ch == 4 ? p[ch - 1] * alpha_scale : 1;
        float sum = q[0] + q[1] + q[2];
        bad |= !(sum - sum == 0) | (q[3] != 1);
    }
    img_free(&a);
    if (s->mask && fold_mask(&b, s->mask, e)) {
        img_free(&b);
        return -1;
    }
    *im = b;
    *all_good = !bad;
    return 0;
}

/* A disc's place in the picture: given, from the lens file's camera, found (then *how says how well), or the
 * largest that fits. */
static int place_disc(double *cx, double *cy, double *r, circle_found *how, const settings *s, const lens *l,
                      const img *im, errmsg *e)
{
    int w = im->info.width, h = im->info.height;
    *cx = s->have_centre ? s->centre[0] : l->focal_px > 0 ? l->centre_px[0] : w / 2.;
    *cy = s->have_centre ? s->centre[1] : l->focal_px > 0 ? l->centre_px[1] : h / 2.;
    *r = s->radius > 0 ? s->radius : l->focal_px > 0 ? l->focal_px / l->scale : (w < h ? w : h) / 2.;
    if (s->centre_auto) {
        circle_found f;
        double known = s->radius > 0 || l->focal_px > 0 ? *r : 0;
        errmsg why;
        if (circle_find(&f, im->pix, w, h, s->from == VIEW_BALL ? CIRCLE_BALL : CIRCLE_LENS, known, &why))
            return err_set(e, "%s: %s", s->in, why.text);
        *how = f;
        *cx = f.x, *cy = f.y;
        if (known == 0) *r = f.r;
    }
    double dx = fmax(fmax(-*cx, *cx - w), 0), dy = fmax(fmax(-*cy, *cy - h), 0);
    if (hypot(dx, dy) >= *r)
        return err_set(
            e,
            "%s: expected the image circle to reach into the picture (%d x %d), found centre %g,%g radius %g",
            s->in, w, h, *cx, *cy, *r);
    return 0;
}

static int make_disc(chart *c, outcome *o, const settings *s, view_kind kind, const img *im, int w, int h,
                     errmsg *e)
{
    lens l;
    char said[512] = "";
    double cx = w / 2., cy = h / 2., r = (w < h ? w : h) / 2.;
    if (kind == VIEW_BALL) {
        double d = s->camera_distance > 0 ? 2 * s->camera_distance / s->diameter : 0;
        if (lens_sphere(&l, d, e)) return -1;
    } else if (kind == VIEW_ANGULAR) {
        memset(&l, 0, sizeof l);
        l.kind = LENS_EQUIDISTANT;
        if (lens_finish(&l, M_PI, e)) return -1;
    } else {
        const lens_use use = {.fov_deg = s->fov_deg,
                              .width = w,
                              .height = h,
                              .placed = im && s->radius > 0,
                              .centre = im && s->have_centre ? s->centre : NULL};
        if (lens_read_for(&l, said, s->lens, &use, e)) return -1;
        if (!im && l.focal_px > 0)
            cx = l.centre_px[0], cy = l.centre_px[1],
            r = l.focal_px / l.scale; /* the camera's picture, as it takes it */
        if (said[0] && !strstr(o->remark, said)) outcome_note(o, "%s", said);
    }
    if (im && place_disc(&cx, &cy, &r, &o->circle, s, &l, im, e)) return -1;
    chart_disc(c, w, h, &l, cx, cy, r, kind == VIEW_BALL, 0, 0, 0);
    return 0;
}

void turn_chart(chart *c, const settings *s, int mirror)
{
    chart_turn(c, mirror, s->rotate_deg * DEG, s->tilt_deg * DEG, s->tilt_to_deg * DEG);
    if (!isnan(s->heading_deg)) chart_face(c, s->heading_deg * DEG);
}

static int is_disc(view_kind kind)
{
    return kind == VIEW_FISHEYE || kind == VIEW_BALL || kind == VIEW_ANGULAR;
}

/* The chart of the input im, or of the output (im NULL).  The camera's turn is IN's, but where a camera's
 * view is made of a probe or a panorama it is that camera's: so the same options lead there and back. */
static int make_chart(chart *c, outcome *o, const settings *s, view_kind kind, const img *im, errmsg *e)
{
    int w = im ? im->info.width : s->out_w, h = im ? im->info.height : s->out_h,
        out_turns = is_disc(s->to) && !is_disc(s->from);
    switch (kind) {
    case VIEW_PROBE: chart_probe(c, w, h, (s->polar_max_deg > 0 ? s->polar_max_deg : 90) * DEG); break;
    case VIEW_LATLONG: chart_latlong(c, w, h, s->span_deg * DEG); break;
    default:
        if (make_disc(c, o, s, kind, im, w, h, e)) return -1;
    }
    if ((im == NULL) == (out_turns != 0)) turn_chart(c, s, kind == VIEW_BALL);
    return 0;
}

void outside_fill(float *rgb, float *alpha, int w, int h, outside_mode mode)
{
    if (mode != OUTSIDE_HOLD) return;
    for (int x = 0; x < w; x++) {
        int last = -1;
        for (int y = 0; y < h; y++) {
            size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (alpha[at] > 0) last = y;
            else if (last >= 0)
                memcpy(rgb + 3 * at, rgb + 3 * ((size_t)last * (size_t)w + (size_t)x), 3 * sizeof(float));
        }
        for (int y = h - 1, next = -1; y >= 0; y--) {
            size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (alpha[at] > 0) next = y;
            else if (next >= 0 && rgb[3 * at] == 0 && rgb[3 * at + 1] == 0 && rgb[3 * at + 2] == 0)
                memcpy(rgb + 3 * at, rgb + 3 * ((size_t)next * (size_t)w + (size_t)x), 3 * sizeof(float));
        }
    }
}

int result_write(const settings *s, const float *rgb, const float *alpha, int partial, const char *view,
                 errmsg *e)
{
    img im;
    int ch = partial && s->outside == OUTSIDE_ALPHA ? 4 : 3;
    if (img_alloc(&im, s->out_w, s->out_h, ch, e)) return -1;
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    for (size_t i = 0; i < n; i++) {
        memcpy(im.pix + i * (size_t)ch, rgb + 3 * i, 3 * sizeof(float));
        if (ch == 4) im.pix[4 * i + 3] = alpha[i];
    }
    static const char *const names[] = {[VIEW_FISHEYE] = "fisheye",
                                        [VIEW_BALL] = "ball",
                                        [VIEW_PROBE] = "probe",
                                        [VIEW_LATLONG] = "latlong",
                                        [VIEW_ANGULAR] = "angular"};
    img_attr attrs[3] = {{.name = "ilf:chart", .kind = IMG_ATTR_STRING, .s = names[s->to]}};
    img_write_opts opts = {
        .type = IMG_FLOAT, .compression = s->compression, .comment = s->command, .attrs = attrs, .nattrs = 1};
    if (s->to == VIEW_PROBE)
        attrs[opts.nattrs++] = (img_attr){.name = "ilf:polarMax",
                                          .kind = IMG_ATTR_FLOAT,
                                          .v = {(s->polar_max_deg > 0 ? s->polar_max_deg : 90) * DEG}};
    if (view) attrs[opts.nattrs++] = (img_attr){.name = "VIEW", .kind = IMG_ATTR_STRING, .s = view};
    if (s->half_float == 1) opts.type = IMG_HALF;
    int rc = img_write(&im, s->out, &opts, e);
    img_free(&im);
    return rc;
}

/* The camera sees itself in a ball: pixels within the hidden angle of the axis get alpha 0. */
void hide_camera(float *pix, int *all_good, const chart *c, double angle)
{
    if (!(angle > 0)) return;
    *all_good = 0;
    double r = c->radius * lens_radius(NULL, &c->lens, angle);
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++)
            if (hypot(x + 0.5 - c->cx, y + 0.5 - c->cy) < r)
                pix[4 * ((size_t)y * (size_t)c->width + (size_t)x) + 3] = 0;
}

void session_free(session *w)
{
    remap_plan_free(w->plan);
    w->plan = NULL;
}

/* What remap_areas needs to know. */
typedef struct remap_job {
    outcome *o;
    session *w;
    const chart *src;
    const remap_source *ready;
} remap_job;

/* By the session's weights where they fit. */
static int remap_areas(float *rgb, float *alpha, const chart *dst, void *arg, errmsg *e)
{
    const remap_job *j = arg;
    session *w = j->w;
    int rc = 0, shared = w && w->several && !j->ready->bad && j->src->width < 65536 && j->src->height < 65536;
    double t0 = cpu_seconds();
    if (shared && !(w->plan && memcmp(&w->src, j->src, sizeof *j->src) == 0 &&
                    memcmp(&w->dst, dst, sizeof *dst) == 0)) {
        session_free(w);
        rc = remap_plan_new(&w->plan, dst, j->src, e);
        w->src = *j->src, w->dst = *dst;
        j->o->cpu_plan_s += cpu_seconds() - t0;
    }
    if (!rc && shared) rc = remap_apply(rgb, alpha, w->plan, j->ready, e);
    else if (!rc) rc = remap_run(rgb, alpha, dst, j->src, j->ready, e);
    return rc;
}

int remap_picture(float *rgb, float *alpha, outcome *o, session *w, const settings *s, img *im, int all_good,
                  const chart *src, const chart *dst, errmsg *e)
{
    remap_source ready;
    double t0 = cpu_seconds(), plan = o->cpu_plan_s;
    if (source_clean(&ready, im->pix, im->info.width, im->info.height, all_good, src, e)) return -1;
    double t1 = cpu_seconds();
    o->cpu_prepare_s += t1 - t0;
    o->bad_pixels += ready.nbad;
    remap_job j = {o, w, src, &ready};
    int rc = filter_texels(rgb, alpha, dst, s->filter_sd, remap_areas, &j, e);
    o->cpu_remap_s += cpu_seconds() - t1 - (o->cpu_plan_s - plan);
    source_free(&ready);
    return rc;
}

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

int job_picture(outcome *o, session *w, const settings *s, errmsg *e)
{
    img im;
    chart src, dst;
    int rc = -1, partial, all_good;
    char view[256];
    float *rgb = NULL, *alpha = NULL;
    if (input_load(&im, &all_good, s, e)) return -1;
    if (make_chart(&src, o, s, s->from, &im, e)) goto done;
    if (make_chart(&dst, o, s, s->to, NULL, e)) goto done;
    if (s->overlay) {
        sphere_seen rim = {src.cx, src.cy, src.radius};
        if (overlay_write(s->overlay, &im, &rim, src.kind == CHART_DISC, e)) goto done;
    }
    if (s->falloff) {
        falloff *f = malloc(sizeof *f);
        double fn = s->aperture > 0 ? s->aperture : im.info.f_number;
        int failed = !f || falloff_read(f, s->falloff, src.lens.half, s->falloff_set, fn, e);
        if (!failed) falloff_apply(im.pix, 4, &src, f);
        if (!failed && f->chosen[0])
            outcome_note(o, "%s: took the set %s; choose with --aperture or --falloff-set", s->falloff,
                         f->chosen);
        free(f);
        if (failed) goto done;
    }
    if (s->from == VIEW_BALL) hide_camera(im.pix, &all_good, &src, s->hide_camera_deg * DEG);
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    rgb = malloc(n * 3 * sizeof(float)), alpha = malloc(n * sizeof(float));
    if (!rgb || !alpha) {
        err_set(e, "out of memory");
        goto done;
    }
    o->cx = src.cx, o->cy = src.cy, o->radius = src.radius;
    if (remap_picture(rgb, alpha, o, w, s, &im, all_good, &src, &dst, e)) goto done;
    if (s->second && second_add(rgb, alpha, o, s, &src, &dst, e)) goto done;
    for (size_t i = 0; s->from == VIEW_BALL && i < 3 * n; i++)
        rgb[i] = (float)(rgb[i] / s->reflectance[i % 3]);
    o->covered = coverage(&partial, alpha, &dst);
    if (o->covered == 0) {
        err_set(e, "%s: expected some of the picture to fall into the output, found none", s->in);
        goto done;
    }
    outside_fill(rgb, alpha, s->out_w, s->out_h, s->outside);
    const int hdr = is_hdr(s->out), named = hdr && radiance_view(view, sizeof view, &dst, s->to) == 0;
    if (hdr && is_disc(s->to) && !named)
        outcome_note(o, "%s: Radiance has no name for this view, so there is no VIEW line", s->out);
    if (hdr && o->covered < 0.9995 && s->outside != OUTSIDE_HOLD)
        outcome_note(o, "%s: %.1f %% of what it shows is not in IN, and black: no alpha channel in .hdr",
                     s->out, 100 * (1 - o->covered));
    rc = result_write(s, rgb, alpha, partial, named ? view : NULL, e);
done:
    free(rgb);
    free(alpha);
    img_free(&im);
    return rc;
}
