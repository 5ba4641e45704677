/*
 * panorama.c - see panorama.h.
 *
 * A picture may state (image.h) that it shows a part of a panorama:
 *
 *   -180            0             180   longitude: 0 in the whole's middle, where its camera looks
 *    +-----------------------------+ 90
 *    |           top               |
 *    |       left+--------+right   |    latitude
 *    |           |   IN   |        |
 *    |           +--------+bottom  |
 *    +-----------------------------+ -90
 */
#include "panorama.h"

#include <math.h>
#include <stdio.h>

#define DEG (M_PI / 180)

typedef struct extent {
    double left, span, top, bottom; /* radians: longitudes, then polar angles from the zenith */
} extent;

/* What the file says, if it can be true of this picture. */
static int stated_extent(extent *x, const char *name, const img_info *in, errmsg *e)
{
    static const char *const say = "say what it shows with --span and --latitudes";
    const double *q = in->pano.shows_deg, w = in->width, h = in->height, a = in->pano.aspect;
    if (!(q[0] >= -180.2 && q[1] <= 180.2 && q[2] <= 90.2 && q[3] >= -90.2 && q[1] - q[0] > 1e-3 &&
          q[2] - q[3] > 1e-3))
        return err_set(
            e,
            "%s: expected a part of a panorama, found by its header longitudes %g to %g and latitudes "
            "%g to %g; %s",
            name, q[0], q[1], q[2], q[3], say);
    if (in->orientation != 1)
        return err_set(
            e,
            "%s: expected a panorama as it lies in the file, found one to be turned by its orientation tag "
            "whose header states what it shows; %s",
            name, say);
    if (a > 0 && fabs(w - h * a) > fmax(0.01 * w, 1.5 * fmax(a, 1)))
        return err_set(
            e,
            "%s: expected a picture %.4g times as wide as high, as its header states of the part of a "
            "panorama that it shows, found %g x %g; %s",
            name, a, w, h, say);
    *x = (extent){q[0] * DEG, fmin(q[1] - q[0], 360) * DEG, fmax(90 - q[2], 0) * DEG,
                  fmin(90 - q[3], 180) * DEG};
    return 0;
}

/* A picture that says nothing is taken for all of the height: odd pixels make one doubt it. */
static void say_odd(outcome *o, const settings *s, double span, double w, double h)
{
    const double across = span / DEG / w, down = 180 / h;
    if (fabs(across - down) <= 0.02 * fmax(across, down)) return;
    outcome_note(
        o,
        "%s: taken for all latitudes from 90 to -90 degrees, so that a pixel is %.3g degrees wide and "
        "%.3g high (--latitudes and --span say otherwise)",
        s->in, across, down);
}

int panorama_place(chart *c, outcome *o, const settings *s, const img *im, int w, int h, errmsg *e)
{
    extent x = {-M_PI, 2 * M_PI, 0, M_PI};
    const int has_span = s->span_deg > 0, has_rows = !isnan(s->latitudes[0]);
    const double *q = im ? im->info.pano.shows_deg : NULL;
    const int stated = im && (q[0] != 0 || q[1] != 0) && !(has_span && has_rows);
    if (stated && stated_extent(&x, s->in, &im->info, e)) return -1;
    if (stated && (x.span < 2 * M_PI * 0.999 || x.bottom - x.top < M_PI * 0.999))
        outcome_note(o, "%s: shows longitudes %.4g to %.4g and latitudes %.4g to %.4g degrees, by its header",
                     s->in, x.left / DEG, (x.left + x.span) / DEG, 90 - x.top / DEG, 90 - x.bottom / DEG);
    if (has_span) x.span = s->span_deg * DEG, x.left = -x.span / 2;
    if (has_rows) x.top = (90 - s->latitudes[0]) * DEG, x.bottom = (90 - s->latitudes[1]) * DEG;
    if (im && !stated && !has_rows) say_odd(o, s, x.span, w, h);
    chart_latlong(c, w, h, x.left, x.span, x.top, x.bottom);
    return 0;
}

/* "heading 12, pitch 3", of what is stated. */
static void pose_in_words(char *text, size_t room, const img_panorama *p)
{
    static const char *const names[] = {"compass heading", "pitch", "roll"};
    size_t n = 0;
    text[0] = 0;
    for (int k = 0; k < 3; k++)
        if (p->has_pose[k] && n < room)
            n += (size_t)snprintf(text + n, room - n, "%s%s %.4g", n ? ", " : "", names[k], p->pose_deg[k]);
}

int panorama_pose(settings *t, outcome *o, const settings *s, const img *im, errmsg *e)
{
    const img_panorama *p = &im->info.pano;
    const int any = p->has_pose[0] | p->has_pose[1] | p->has_pose[2];
    char words[128];
    *t = *s;
    pose_in_words(words, sizeof words, p);
    if (s->have_pose == 2) {
        if (!any) return err_set(e, "%s: expected a header that states the camera's pose, found none", s->in);
        t->heading_deg = 90 - p->pose_deg[0], t->tilt_deg = p->pose_deg[1], t->rotate_deg = -p->pose_deg[2];
        outcome_note(o, "%s: %s degrees, by its header%s; north is v", s->in, words,
                     p->has_pose[0] ? "" : ", and heading taken as 0");
        return 0;
    }
    const double *q = p->pose_deg;
    const int level = fabs(q[1]) < 0.05 && fabs(q[2]) < 0.05;
    if (!any || level || !isnan(s->heading_deg) || s->tilt_deg != 0 || s->rotate_deg != 0) return 0;
    if (s->to == VIEW_LATLONG)
        outcome_note(o,
                     "%s: its header's pose, %s degrees, is not used (--tilt %.4g --rotate %.4g levels it)",
                     s->in, words, q[1], 0 - q[2]);
    else outcome_note(o, "%s: its header's pose, %s degrees, is not used (--pose stated does)", s->in, words);
    return 0;
}
