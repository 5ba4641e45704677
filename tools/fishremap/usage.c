/*
 * usage.c - which options fishremap needs, and which mean something, for the pictures at hand.
 *
 * An option that would change nothing is refused: whoever gave it expects something of it.
 */
#include <math.h>
#include <string.h>

#include "options.h"

static int ends_with(const char *s, const char *end)
{
    size_t n = strlen(s), m = strlen(end);
    return n >= m && strcmp(s + n - m, end) == 0;
}

static const char *const names[] = {"fisheye", "ball", "probe", "latlong", "angular"};

/* --pose in words of the other options: first rolled (the picture turns the other way), then pitched, then
 * headed. */
static void take_pose(settings *s)
{
    if (!s->have_pose) return;
    const char *other = !isnan(s->heading_deg)   ? "heading"
                        : !isnan(s->tilt_deg)    ? "tilt"
                        : !isnan(s->tilt_to_deg) ? "tilt-to"
                        : !isnan(s->rotate_deg)  ? "rotate"
                                                 : NULL;
    if (other)
        cli_fail(CLI_USAGE, "--%s: expected none beside --pose, which says how the camera stood", other);
    if (s->have_pose == 2) return;
    s->heading_deg = s->pose[0], s->tilt_deg = s->pose[1], s->rotate_deg = -s->pose[2];
}

static void check_needs(const settings *s, int operands)
{
    if (operands < 1) cli_fail(CLI_USAGE, "expected an input picture, found none");
    if (!s->out) cli_fail(CLI_USAGE, "expected -o OUT, found none");
    if (operands > 1 && (s->nu || !strchr(s->out, '%') || s->overlay))
        cli_fail(CLI_USAGE, "expected one input picture%s, found %d",
                 s->nu        ? " of an array"
                 : s->overlay ? " with --overlay"
                              : ", or an OUT with a % for the pictures' names",
                 operands);
    if (!s->out_w) cli_fail(CLI_USAGE, "expected --size WxH, found none");
    if (!s->nu && (s->from == VIEW_FISHEYE || s->to == VIEW_FISHEYE) && !s->lens)
        cli_fail(CLI_USAGE, "expected --lens MODEL, found none");
    if (s->nu && !s->corners_auto && !s->ncorners)
        cli_fail(CLI_USAGE, "expected --corners with --array, found none");
    if (s->nu * s->nv > 1 && !s->corners_auto && s->ncorners != 4)
        cli_fail(CLI_USAGE, "expected four corners for %dx%d spheres, found %d", s->nu, s->nv, s->ncorners);
    if (s->second && !(s->second_view[2] > 0))
        cli_fail(CLI_USAGE, "expected --second-view X,Y,R,TILT,TO[,ROTATE] with --second, found none");
    if (s->camera_distance > 0 && !(s->camera_distance > (s->diameter > 0 ? s->diameter : 1) / 2))
        cli_fail(CLI_USAGE,
                 "--camera-distance: expected a camera outside of the sphere, more than %g from its centre, "
                 "found %g",
                 (s->diameter > 0 ? s->diameter : 1) / 2, s->camera_distance);
}

/* One option: was it given, does it mean something here, and if not, what it goes with. */
typedef struct rule {
    const char *name;
    int given, fits;
    const char *with;
} rule;

static void check_rules(const rule *r, int n, const settings *s)
{
    for (int k = 0; k < n; k++) {
        if (!r[k].given || r[k].fits) continue;
        if (s->nu)
            cli_fail(CLI_USAGE, "--%s: expected %s, found --array %dx%d -o %s", r[k].name, r[k].with, s->nu,
                     s->nv, s->out);
        cli_fail(CLI_USAGE, "--%s: expected %s, found --from %s --to %s -o %s", r[k].name, r[k].with,
                 names[s->from], names[s->to], s->out);
    }
}

static void check_meaning(const settings *s)
{
    const int array = s->nu > 0, field = array && ends_with(s->out, ".ilf.exr"),
              exr = ends_with(s->out, ".exr");
    const view_kind from = s->from, to = s->to;
    const int fisheye = !array && (from == VIEW_FISHEYE || to == VIEW_FISHEYE),
              disc = !array && from != VIEW_PROBE && from != VIEW_LATLONG;
    const int ball = array || from == VIEW_BALL, falloff = disc && from != VIEW_BALL;
    const int posed = array && s->nu > 1 && s->nv > 1 && s->camera_distance > 0;
    const int all = !array && s->polar_max_deg == 180; /* limits nothing, whatever the chart */
    const int out_turns =
        to != VIEW_PROBE && to != VIEW_LATLONG && (from == VIEW_PROBE || from == VIEW_LATLONG);
    const int one_fisheye = !array && from == VIEW_FISHEYE && to != VIEW_FISHEYE;
    const int grid = array || to == VIEW_PROBE || to == VIEW_LATLONG;
    const rule rules[] = {
        {"from", array && s->from != VIEW_BALL, 0, "a picture of one thing, or none with mirror spheres"},
        {"to", array && s->to != VIEW_PROBE, 0, "none with mirror spheres: OUT holds probes"},
        {"lens", s->lens != NULL, fisheye, "a fisheye picture as IN or OUT"},
        {"fov", s->fov_deg > 0, fisheye, "a fisheye picture as IN or OUT"},
        {"centre", s->centre_auto, disc, "a fisheye, ball or angular picture as IN"},
        {"centre", s->have_centre, disc || posed,
         "a fisheye, ball or angular picture as IN, or an array with --camera-distance"},
        {"radius", s->radius > 0, disc, "a fisheye, ball or angular picture as IN"},
        {"falloff", s->falloff != NULL, falloff, "a fisheye or angular picture as IN"},
        {"falloff-set", s->falloff_set != NULL, s->falloff != NULL, "--falloff"},
        {"aperture", s->aperture > 0, s->falloff && !s->falloff_set, "--falloff, without --falloff-set"},
        {"polar-max", s->polar_max_deg > 0, array || from == VIEW_PROBE || to == VIEW_PROBE || all,
         "a probe as IN or OUT"},
        {"span", s->span_deg > 0, !array && (from == VIEW_LATLONG || to == VIEW_LATLONG),
         "a latlong picture as IN or OUT"},
        {"tilt", !isnan(s->tilt_deg) && !s->have_pose, !posed,
         "an array without --camera-distance, from which the tilt follows"},
        {"tilt-to", !isnan(s->tilt_to_deg), !isnan(s->tilt_deg), "--tilt"},
        {"heading", !isnan(s->heading_deg) && !s->have_pose, !array, "one picture"},
        {"pose", s->have_pose,
         !array && (s->have_pose == 1 || from == VIEW_LATLONG) && !(s->have_pose == 2 && out_turns),
         s->have_pose == 2 ? "a panorama as IN, and no camera's picture as OUT" : "one picture"},
        {"latitudes", !isnan(s->latitudes[0]), !array && (from == VIEW_LATLONG || to == VIEW_LATLONG),
         "a latlong picture as IN or OUT"},
        {"nadir", !isnan(s->nadir_deg), !array && (from == VIEW_LATLONG || from == VIEW_FISHEYE),
         "a panorama or fisheye picture as IN"},
        {"dual", s->dual && !s->ncircles && !s->circles_auto, one_fisheye,
         "a fisheye picture as IN, and no fisheye as OUT"},
        {"circles", s->dual && (s->ncircles || s->circles_auto), one_fisheye,
         "a fisheye picture as IN, and no fisheye as OUT"},
        {"circle-rotate", !isnan(s->circle_rotate[0]), s->dual, "--dual or --circles"},
        {"lens", s->lens2 != NULL, s->dual, "one, as there is one circle (--dual, --circles: two)"},
        {"falloff", s->falloff2 != NULL, s->dual, "one, as there is one circle (--dual, --circles: two)"},
        {"centre", s->centre_auto || s->have_centre, !s->dual, "--circles, for two circles"},
        {"radius", s->radius > 0, !s->dual, "--circles, for two circles"},
        {"outside", s->outside != OUTSIDE_NONE, !field || s->outside == OUTSIDE_HOLD,
         "hold: a light field of spheres has no alpha"},
        {"outside", s->outside == OUTSIDE_ALPHA, exr,
         "black: only an OUT that ends in .exr has an alpha channel"},
        {"outside", s->outside == OUTSIDE_HOLD, grid,
         "alpha or black: only a probe or latlong picture has columns to hold"},
        {"overlay", s->overlay != NULL, array || disc,
         "a picture with circles to draw: fisheye, ball, angular or --array as IN"},
        {"corners", s->corners_auto || s->ncorners, array, "--array"},
        {"plane", s->have_plane, field, "--array, and an OUT that ends in .ilf.exr"},
        {"camera-distance", s->camera_distance > 0, ball || to == VIEW_BALL,
         "a mirror ball as IN or OUT, or --array"},
        {"diameter", s->diameter > 0, s->camera_distance > 0, "--camera-distance"},
        {"reflectance", s->reflectance[0] > 0, ball, "a mirror ball or --array as IN"},
        {"hide-camera", !isnan(s->hide_camera_deg), ball, "a mirror ball or --array as IN"},
        {"second", s->second != NULL, !array && from == VIEW_BALL, "--from ball"},
        {"second-view", s->second_view[2] > 0, s->second != NULL, "--second FILE"},
        {"second-mask", s->second_mask != NULL, s->second != NULL, "--second FILE"},
        {"second-gain", s->have_second_gain, s->second != NULL || s->dual, "--second FILE, or two circles"},
        {"type", s->half_float >= 0, exr, "an OUT that ends in .exr"},
        {"compression", s->compression != NULL, exr, "an OUT that ends in .exr"},
    };
    check_rules(rules, (int)(sizeof rules / sizeof *rules), s);
}

void usage_check(settings *s, int operands)
{
    if (s->from == VIEW_NONE) s->from = s->nu ? VIEW_BALL : VIEW_FISHEYE;
    if (s->to == VIEW_NONE) s->to = VIEW_PROBE;
    take_pose(s);
    check_needs(s, operands);
    check_meaning(s);
    if (isnan(s->rotate_deg)) s->rotate_deg = 0;
    if (isnan(s->tilt_deg)) s->tilt_deg = 0;
    if (isnan(s->tilt_to_deg)) s->tilt_to_deg = 90;
    if (isnan(s->nadir_deg)) s->nadir_deg = 0;
    for (int k = 0; k < 2; k++)
        if (isnan(s->circle_rotate[k])) s->circle_rotate[k] = 0;
    if (isnan(s->hide_camera_deg)) s->hide_camera_deg = 0;
    if (isnan(s->filter_sd)) s->filter_sd = 0;
    if (!(s->diameter > 0)) s->diameter = 1;
    for (int k = 0; k < 3; k++)
        if (!(s->reflectance[k] > 0)) s->reflectance[k] = 1;
    if (s->outside == OUTSIDE_NONE) s->outside = OUTSIDE_ALPHA;
    if (s->half_float < 0) s->half_float = 0;
}
