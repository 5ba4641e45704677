/*
 * options.c - fishremap's options: one table for parsing and --help, and the values' ranges.
 *
 * What means nothing for the pictures at hand is usage.c's to refuse; what was not given is NaN, 0 or NULL
 * until then (settings.h).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "filter.h"
#include "options.h"

#define FARTHEST                                                                                             \
    1e9 /* pixels: far beyond any picture, and far from where doubles lose a pixel's fractions               \
         */
#define TURNS 36000.

static int within(const double *v, int n, double most)
{
    for (int k = 0; k < n; k++)
        if (!(fabs(v[k]) <= most)) return 0;
    return 1;
}

/* A number within its range. */
typedef struct ranged {
    double *dest, least, most;
    const char *what;
} ranged;

static int opt_ranged(const char *v, void *arg, errmsg *e)
{
    const ranged *r = arg;
    double x;
    if (cli_parse_double(&x, v, e)) return -1;
    if (!(x >= r->least && x <= r->most)) return err_set(e, "expected %s, found %s", r->what, v);
    *r->dest = x;
    return 0;
}

static int opt_size(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    return cli_parse_size(&s->out_w, &s->out_h, v, e);
}

static int opt_centre(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    s->centre_auto = strcmp(v, "auto") == 0;
    s->have_centre = !s->centre_auto;
    if (s->centre_auto) return 0;
    if (cli_parse_doubles(s->centre, 2, v, ",", e)) return -1;
    return within(s->centre, 2, FARTHEST) ? 0
                                          : err_set(e, "expected pixels, up to %g, found %s", FARTHEST, v);
}

static int opt_array(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    if (cli_parse_size(&s->nu, &s->nv, v, e)) return -1;
    if ((int64_t)s->nu * s->nv > 1 << 20)
        return err_set(e, "expected an array of up to 2^20 spheres, found %s", v);
    return 0;
}

static int opt_corners(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    s->corners_auto = strcmp(v, "auto") == 0;
    if (s->corners_auto) return 0;
    char *copy = strdup(v), *rest = NULL;
    if (!copy) return err_set(e, "out of memory");
    s->ncorners = 0;
    for (char *w = strtok_r(copy, " \t;", &rest); w; w = strtok_r(NULL, " \t;", &rest)) {
        double q[3];
        errmsg why;
        if (s->ncorners == 4 || cli_parse_doubles(q, 3, w, ",", &why)) {
            free(copy);
            return err_set(e, "expected auto, or 1 to 4 of X,Y,R, found %.80s", v);
        }
        if (!within(q, 3, FARTHEST)) {
            free(copy);
            return err_set(e, "expected spheres in the picture, X,Y,R up to %g pixels, found %.80s", FARTHEST,
                           v);
        }
        s->corner[s->ncorners++] = (sphere_seen){q[0], q[1], q[2]};
    }
    free(copy);
    if (s->ncorners < 1) return err_set(e, "expected auto, or 1 to 4 of X,Y,R, found nothing");
    return 0;
}

/* Both circles: X,Y,R X,Y,R, or auto. */
static int opt_circles(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    double q[6];
    s->circles_auto = strcmp(v, "auto") == 0;
    if (s->circles_auto) {
        s->dual = 1, s->ncircles = 0;
        return 0;
    }
    char *copy = strdup(v);
    errmsg why;
    if (!copy) return err_set(e, "out of memory");
    for (char *p = copy; *p; p++)
        if (strchr(" \t;", *p)) *p = ',';
    const int bad = cli_parse_doubles(q, 6, copy, ",", &why);
    free(copy);
    if (bad || !within(q, 6, FARTHEST) || !(q[2] > 0) || !(q[5] > 0))
        return err_set(e, "expected auto, or two circles \"X,Y,R X,Y,R\" in pixels, R above 0, found %.80s",
                       v);
    memcpy(s->circle, q, sizeof q);
    s->ncircles = 2;
    s->dual = 1;
    return 0;
}

static int opt_circle_rotate(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    if (cli_parse_doubles(s->circle_rotate, 2, v, ",", e)) return -1;
    return within(s->circle_rotate, 2, TURNS) ? 0 : err_set(e, "expected two angles in degrees, found %s", v);
}

static int opt_latitudes(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    double q[2];
    if (cli_parse_doubles(q, 2, v, ",", e)) return -1;
    if (!(q[0] <= 90 && q[1] >= -90 && q[0] - q[1] >= 1e-6))
        return err_set(e, "expected latitudes TOP,BOTTOM from 90 down to -90 degrees, found %s", v);
    memcpy(s->latitudes, q, sizeof q);
    return 0;
}

/* HEADING[,PITCH[,ROLL]], or stated. */
static int opt_pose(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    int n = 1;
    s->have_pose = 2;
    if (strcmp(v, "stated") == 0) return 0;
    s->have_pose = 1;
    memset(s->pose, 0, sizeof s->pose);
    for (const char *p = v; *p; p++) n += *p == ',';
    if (n > 3) return err_set(e, "expected stated, or HEADING,PITCH,ROLL in degrees, found %s", v);
    if (cli_parse_doubles(s->pose, n, v, ",", e)) return -1;
    return within(s->pose, n, TURNS) ? 0 : err_set(e, "expected angles in degrees, found %s", v);
}

/* One file, or one for each of two circles. */
static int one_or_two(const char **first, const char **second, const char *v, errmsg *e)
{
    if (*first && *second) return err_set(e, "expected one, or two for two circles, found a third: %s", v);
    *(*first ? second : first) = v;
    return 0;
}

static int opt_lens(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    return one_or_two(&s->lens, &s->lens2, v, e);
}

static int opt_falloff(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    return one_or_two(&s->falloff, &s->falloff2, v, e);
}

static int opt_plane(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    s->have_plane = 1;
    if (cli_parse_doubles(s->plane, 9, v, " ", e)) return -1;
    return within(s->plane, 9, 1e12) ? 0 : err_set(e, "expected coordinates up to 1e12, found %s", v);
}

static int opt_reflectance(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    if (!strchr(v, ',')) {
        if (cli_parse_double(s->reflectance, v, e)) return -1;
        s->reflectance[1] = s->reflectance[2] = s->reflectance[0];
    } else if (cli_parse_doubles(s->reflectance, 3, v, ",", e)) {
        return -1;
    }
    for (int k = 0; k < 3; k++)
        if (!(s->reflectance[k] > 0 && s->reflectance[k] <= 1))
            return err_set(e, "expected reflectances above 0 and up to 1, found %s", v);
    return 0;
}

/* X,Y,R,TILT,TO and, as an afterthought, ROTATE. */
static int opt_second(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    double q[6];
    int n = 1;
    for (const char *p = v; *p; p++) n += *p == ',';
    if (n < 5 || n > 6) return err_set(e, "expected X,Y,R,TILT,TO or X,Y,R,TILT,TO,ROTATE, found %s", v);
    if (cli_parse_doubles(q, n, v, ",", e)) return -1;
    if (!within(q, 3, FARTHEST) || !(q[2] > 0) || !within(q + 3, n - 3, TURNS))
        return err_set(
            e, "expected a ball in the picture, X,Y,R with a radius above 0, and angles in degrees, found %s",
            v);
    memcpy(s->second_view, q, sizeof(double) * (size_t)n);
    s->second_rotates = n == 6;
    return 0;
}

static int opt_second_gain(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    s->have_second_gain = 1;
    s->second_gain = 0;
    if (strcmp(v, "auto") == 0) return 0;
    if (cli_parse_double(&s->second_gain, v, e)) return -1;
    return s->second_gain >= 1e-6 && s->second_gain <= 1e6
               ? 0
               : err_set(e, "expected auto, or a factor of 1e-6 to 1e6, found %s", v);
}

static int choose(int *out, const char *v, const char *const *names, errmsg *e)
{
    char list[128] = "";
    for (int k = 0; names[k]; k++) {
        if (strcmp(v, names[k]) == 0) {
            *out = k;
            return 0;
        }
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", k ? ", " : "", names[k]);
    }
    return err_set(e, "expected one of %s, found %s", list, v);
}

static const char *const view_names[] = {"fisheye", "ball", "probe", "latlong", "angular", NULL};

static int opt_from(const char *v, void *arg, errmsg *e)
{
    int k = 0, rc = choose(&k, v, view_names, e);
    ((settings *)arg)->from = (view_kind)k;
    return rc;
}

static int opt_to(const char *v, void *arg, errmsg *e)
{
    int k = 0, rc = choose(&k, v, view_names, e);
    ((settings *)arg)->to = (view_kind)k;
    return rc;
}

static int opt_outside(const char *v, void *arg, errmsg *e)
{
    static const char *const names[] = {"alpha", "black", "hold", NULL};
    int k = 0, rc = choose(&k, v, names, e);
    ((settings *)arg)->outside = (outside_mode)k;
    return rc;
}

static int opt_filter(const char *v, void *arg, errmsg *e)
{
    static const char gaussian[] = "gaussian";
    settings *s = arg;
    const size_t n = sizeof gaussian - 1;
    s->filter_sd = 0;
    if (strcmp(v, "area") == 0) return 0;
    if (strncmp(v, gaussian, n) != 0 || (v[n] && v[n] != ':'))
        return err_set(e, "expected area, gaussian or gaussian:SD, found '%s'", v);
    s->filter_sd = 0.5;
    if (v[n] && cli_parse_doubles(&s->filter_sd, 1, v + n + 1, ",", e)) return -1;
    if (!(s->filter_sd >= FILTER_LEAST && s->filter_sd <= FILTER_MOST))
        return err_set(e, "expected a standard deviation of %g to %g texels, found %g", FILTER_LEAST,
                       FILTER_MOST, s->filter_sd);
    return 0;
}

static int opt_type(const char *v, void *arg, errmsg *e)
{
    static const char *const names[] = {"float", "half", NULL};
    return choose(&((settings *)arg)->half_float, v, names, e);
}

settings cfg = {.from = VIEW_NONE,
                .to = VIEW_NONE,
                .outside = OUTSIDE_NONE,
                .rotate_deg = NAN,
                .tilt_deg = NAN,
                .tilt_to_deg = NAN,
                .heading_deg = NAN,
                .latitudes = {NAN, NAN},
                .nadir_deg = NAN,
                .circle_rotate = {NAN, NAN},
                .hide_camera_deg = NAN,
                .filter_sd = NAN,
                .half_float = -1};

#define ANGLES "degrees, 36000 (a hundred turns) either way at most"
static ranged fov = {&cfg.fov_deg, 1e-9, 1e6, "an angle above 0"},
              radius = {&cfg.radius, 1e-3, FARTHEST, "pixels, .001 to 1e9"},
              aperture = {&cfg.aperture, 1e-3, 1e4, "an f-number, .001 to 10000"},
              polar_max = {&cfg.polar_max_deg, 1e-6, 180, "an angle above 0 and up to 180 degrees"},
              span = {&cfg.span_deg, 1e-6, 360, "an angle above 0 and up to 360 degrees"},
              turn = {&cfg.rotate_deg, -TURNS, TURNS, ANGLES}, tilt = {&cfg.tilt_deg, -TURNS, TURNS, ANGLES},
              tilt_to = {&cfg.tilt_to_deg, -TURNS, TURNS, ANGLES},
              heading = {&cfg.heading_deg, -TURNS, TURNS, ANGLES},
              distance = {&cfg.camera_distance, 1e-12, 1e12, "a length above 0 and up to 1e12"},
              diameter = {&cfg.diameter, 1e-12, 1e12, "a length above 0 and up to 1e12"},
              hide = {&cfg.hide_camera_deg, 0, 89.999, "0 to below 90 degrees"},
              nadir = {&cfg.nadir_deg, 0, 89.999, "0 to below 90 degrees"};

static const cli_opt options[] = {
    {"lens", 'l', CLI_CALL, &cfg, opt_lens, "MODEL",
     "equidistant, equisolid, stereographic, orthographic, or a lens file (FILE@NAME: one of its cameras); "
     "twice "
     "for two circles"},
    {"fov", 'f', CLI_CALL, &fov, opt_ranged, "DEG", "field of view of the image circle, degrees"},
    {"size", 's', CLI_CALL, &cfg, opt_size, "WxH", "output size, pixels; of each probe for an array"},
    {"centre", 'c', CLI_CALL, &cfg, opt_centre, "X,Y",
     "centre of the image circle, pixels from the top-left corner (default: the picture's), or auto: fit the "
     "circle"},
    {"radius", 'r', CLI_CALL, &radius, opt_ranged, "PX",
     "radius of the image circle (default: half the shorter side)"},
    {"dual", 0, CLI_FLAG, &cfg.dual, NULL, NULL,
     "IN shows two circles, one in each half, of lenses that look opposite ways; merge them"},
    {"circles", 0, CLI_CALL, &cfg, opt_circles, "\"X,Y,R X,Y,R\"",
     "the same, where the circles are: of the lens that looks ahead, then the other; or auto: fit one in "
     "each half"},
    {"circle-rotate", 0, CLI_CALL, &cfg, opt_circle_rotate, "DEG,DEG",
     "turn each circle's picture counter-clockwise about its centre, to stand upright (default 0,0)"},
    {"falloff", 0, CLI_CALL, &cfg, opt_falloff, "FILE",
     "divide by this brightness falloff (falloffcal's file, or polynomials); twice for two circles"},
    {"falloff-set", 0, CLI_STRING, &cfg.falloff_set, NULL, "NAME",
     "which set of a falloff file, such as f5.6"},
    {"aperture", 0, CLI_CALL, &aperture, opt_ranged, "N",
     "f-number that picks the falloff's set (default: the picture's)"},
    {"polar-max", 'p', CLI_CALL, &polar_max, opt_ranged, "DEG",
     "polar angle at the probe's lower edge (default 90)"},
    {"rotate", 0, CLI_CALL, &turn, opt_ranged, "DEG",
     "the camera that took IN: turn its picture counter-clockwise about the centre first"},
    {"tilt", 0, CLI_CALL, &tilt, opt_ranged, "DEG",
     "the camera's axis leans by this from the plane's normal"},
    {"tilt-to", 0, CLI_CALL, &tilt_to, opt_ranged, "DEG",
     "towards this side of the (turned) picture, counter-clockwise from right (default 90: its top)"},
    {"heading", 0, CLI_CALL, &heading, opt_ranged, "DEG",
     "the camera looks at the horizon, n up, DEG counter-clockwise from u"},
    {"pose", 0, CLI_CALL, &cfg, opt_pose, "H[,P[,R]]",
     "the camera looks H degrees counter-clockwise from u, nose up by P, right side down by R; or stated: as "
     "a "
     "panorama's header says"},
    {"from", 0, CLI_CALL, &cfg, opt_from, "VIEW",
     "what IN is: fisheye (default), ball, probe, latlong (a panorama) or angular"},
    {"to", 0, CLI_CALL, &cfg, opt_to, "VIEW",
     "what OUT shall be: probe (default), fisheye, ball, latlong or angular"},
    {"span", 0, CLI_CALL, &span, opt_ranged, "DEG", "longitudes across a latlong picture (default 360)"},
    {"latitudes", 0, CLI_CALL, &cfg, opt_latitudes, "TOP,BOTTOM",
     "of a latlong picture's upper and lower edge, degrees (default: as IN states, else 90,-90)"},
    {"outside", 0, CLI_CALL, &cfg, opt_outside, "MODE",
     "directions that IN does not show: alpha (default; black, with an alpha channel), black, or hold "
     "(nearest in the column)"},
    {"filter", 0, CLI_CALL, &cfg, opt_filter, "NAME",
     "a texel's mean: area (default; its own), gaussian (0.5) or gaussian:SD (texels)"},
    {"overlay", 0, CLI_STRING, &cfg.overlay, NULL, "FILE.png",
     "write IN with the circles found, or given, drawn on it"},
    {"report", 0, CLI_STRING, &cfg.report, NULL, "FILE", "write what was found, and CPU times, as JSON"},
    {"mask", 'm', CLI_STRING, &cfg.mask, NULL, "FILE",
     "picture of IN's size, or smaller with its aspect; where it is black, IN is not used"},
    {"nadir", 0, CLI_CALL, &nadir, opt_ranged, "DEG",
     "leave out what lies within DEG of straight below the camera (tripod, operator)"},
    {"array", 'a', CLI_CALL, &cfg, opt_array, "NxM", "IN shows N x M mirror spheres; OUT is a light field"},
    {"corners", 0, CLI_CALL, &cfg, opt_corners, "LIST",
     "corner spheres \"X,Y,R X,Y,R X,Y,R X,Y,R\": (0,0), (N-1,0), (N-1,M-1), (0,M-1), or auto"},
    {"plane", 0, CLI_CALL, &cfg, opt_plane, "\"O U V\"",
     "nine numbers: the light field's origin and edge vectors (default: unit pitch from 0,0,0 along x and "
     "y)"},
    {"camera-distance", 0, CLI_CALL, &distance, opt_ranged, "D",
     "camera to spheres, unit of --diameter (default: infinite)"},
    {"diameter", 0, CLI_CALL, &diameter, opt_ranged, "D", "sphere's diameter (default 1)"},
    {"reflectance", 0, CLI_CALL, &cfg, opt_reflectance, "R,G,B",
     "of the mirror spheres; the result is divided by it (default 1)"},
    {"hide-camera", 0, CLI_CALL, &hide, opt_ranged, "DEG",
     "leave out what a sphere reflects within DEG of the camera's direction"},
    {"second", 0, CLI_STRING, &cfg.second, NULL, "FILE",
     "another picture of the same ball, from elsewhere, to combine with IN"},
    {"second-view", 0, CLI_CALL, &cfg, opt_second, "X,Y,R,TILT,TO[,ROTATE]",
     "its ball, pixels, and its camera's --tilt, --tilt-to and --rotate (default: as IN's), degrees"},
    {"second-mask", 0, CLI_STRING, &cfg.second_mask, NULL, "FILE", "as --mask, for the second picture"},
    {"second-gain", 0, CLI_CALL, &cfg, opt_second_gain, "G",
     "factor of the second picture's (or circle's) light, or auto (default): matched over what both show"},
    {"layer", 0, CLI_STRING, &cfg.layer, NULL, "NAME",
     "which layer, part or view of an OpenEXR picture that has several"},
    {"dry-run", 0, CLI_FLAG, &cfg.dry_run, NULL, NULL,
     "check the options and the files that they name; read no picture, write nothing"},
    {"type", 't', CLI_CALL, &cfg, opt_type, "TYPE", "EXR pixels: float (default) or half"},
    {"compression", 0, CLI_STRING, &cfg.compression, NULL, "NAME", "EXR compression (default zip)"},
    {"output", 'o', CLI_STRING, &cfg.out, NULL, "OUT",
     "picture (.exr or .hdr), or .ilf.exr for an array; for several IN a name with a % for theirs"},
    {0},
};

static const cli_choice choices[] = {
    {"lens", "equidistant equisolid stereographic orthographic FILE"},
    {"centre", "auto"},
    {"circles", "auto"},
    {"pose", "stated"},
    {"from", "fisheye ball probe latlong angular"},
    {"to", "probe fisheye ball latlong angular"},
    {"outside", "alpha black hold"},
    {"filter", "area gaussian"},
    {"corners", "auto"},
    {"second-gain", "auto"},
    {"type", "float half"},
    {"compression", "none rle zips zip piz pxr24 b44 b44a"},
    {0},
};

const cli_prog prog = {
    "fishremap",
    "-o OUT IN...",
    "Remap a fisheye picture, a mirror ball or a mirror-sphere array to latitude/longitude light probes.",
    options,
    "Every output texel is a mean over its footprint in the picture, so that a lamp keeps its energy.",
    choices};
