/* placing.c - see placing.h. */
#include "placing.h"

#include <math.h>
#include <string.h>

#include "lensfile.h"
#include "panorama.h"

#define DEG (M_PI / 180)

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

int view_is_disc(view_kind kind)
{
    return kind == VIEW_FISHEYE || kind == VIEW_BALL || kind == VIEW_ANGULAR;
}

void say_zenith(outcome *o, const settings *s)
{
    outcome_note(
        o,
        "%s: with a heading n is up, and so the zenith is in the panorama's middle (--tilt and --rotate "
        "alone level one)",
        s->out);
}

int place_chart(chart *c, outcome *o, const settings *s, view_kind kind, const img *im, errmsg *e)
{
    int w = im ? im->info.width : s->out_w, h = im ? im->info.height : s->out_h,
        out_turns = view_is_disc(s->to) && !view_is_disc(s->from);
    switch (kind) {
    case VIEW_PROBE: chart_probe(c, w, h, (s->polar_max_deg > 0 ? s->polar_max_deg : 90) * DEG); break;
    case VIEW_LATLONG:
        if (panorama_place(c, o, s, im, w, h, e)) return -1;
        break;
    default:
        if (make_disc(c, o, s, kind, im, w, h, e)) return -1;
    }
    if ((im == NULL) != (out_turns != 0)) return 0;
    settings t = *s;
    if (im && kind == VIEW_LATLONG && panorama_pose(&t, o, s, im, e)) return -1;
    turn_chart(c, &t, kind == VIEW_BALL);
    if (im && s->to == VIEW_LATLONG && !isnan(t.heading_deg)) say_zenith(o, s);
    return 0;
}

/* In a panorama straight down is the lower pole; in a disc it lies at the axis's side that the picture's bottom
 * shows, turned with the picture: rotate, radians, is what the picture must be turned by to stand upright. */
static int below(const chart *c, double rotate, double angle, int x, int y)
{
    if (c->kind == CHART_GRID) return c->polar_min + (y + 0.5) * chart_row_step(c) > M_PI - angle;
    double px, py;
    chart_disc_place(&px, &py, c, x + 0.5, y + 0.5);
    const double up = px * sin(rotate) + py * cos(rotate), r = hypot(px, py);
    if (up >= 0 || up * up < r * r * cos(angle) * cos(angle)) return 0; /* not even at the horizon */
    return sin(lens_angle(&c->lens, r)) * -up / r > cos(angle);
}

void hide_nadir(float *pix, int *all_good, const chart *c, double rotate, double angle)
{
    if (!(angle > 0)) return;
    *all_good = 0;
#pragma omp parallel for schedule(dynamic, 16)
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++)
            if (below(c, rotate, angle, x, y)) pix[4 * ((size_t)y * (size_t)c->width + (size_t)x) + 3] = 0;
}

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
