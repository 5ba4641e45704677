/*
 * fishremap - camera pictures to calibrated light probes.
 *
 * This file owns the command line and the messages; picture.c and spherearray.c do the two jobs.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "filter.h"
#include "outfile.h"
#include "settings.h"

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
    return s->centre_auto ? 0 : cli_parse_doubles(s->centre, 2, v, ",", e);
}

static int opt_array(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    if (cli_parse_size(&s->nu, &s->nv, v, e)) return -1;
    if ((int64_t)s->nu * s->nv > 1 << 20) return err_set(e, "expected an array of up to 2^20 spheres, found %s", v);
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
        s->corner[s->ncorners++] = (sphere_seen){q[0], q[1], q[2]};
    }
    free(copy);
    if (s->ncorners < 1) return err_set(e, "expected auto, or 1 to 4 of X,Y,R, found nothing");
    return 0;
}

static int opt_plane(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    s->have_plane = 1;
    return cli_parse_doubles(s->plane, 9, v, " ", e);
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

static int opt_second(const char *v, void *arg, errmsg *e)
{
    settings *s = arg;
    if (cli_parse_doubles(s->second_view, 5, v, ",", e)) return -1;
    return s->second_view[2] > 0 ? 0 : err_set(e, "expected X,Y,R,TILT,TO with a radius above 0, found %s", v);
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
    if (strncmp(v, gaussian, n) != 0 || (v[n] && v[n] != ':')) return err_set(e, "expected area, gaussian or gaussian:SD, found '%s'", v);
    s->filter_sd = 0.5;
    if (v[n] && cli_parse_doubles(&s->filter_sd, 1, v + n + 1, ",", e)) return -1;
    if (!(s->filter_sd >= FILTER_LEAST && s->filter_sd <= FILTER_MOST))
        return err_set(e, "expected a standard deviation of %g to %g texels, found %g", FILTER_LEAST, FILTER_MOST, s->filter_sd);
    return 0;
}

static int opt_type(const char *v, void *arg, errmsg *e)
{
    static const char *const names[] = {"float", "half", NULL};
    return choose(&((settings *)arg)->half_float, v, names, e);
}

static settings cfg = {.from = VIEW_FISHEYE, .to = VIEW_PROBE, .span_deg = 360, .tilt_to_deg = 90,
                       .diameter = 1, .reflectance = {1, 1, 1}, .half_float = 0};

static const cli_opt options[] = {
    {"lens", 'l', CLI_STRING, &cfg.lens, NULL, "MODEL", "equidistant, equisolid, stereographic, orthographic, or a lens file"},
    {"fov", 'f', CLI_DOUBLE, &cfg.fov_deg, NULL, "DEG", "field of view of the image circle, degrees"},
    {"size", 's', CLI_CALL, &cfg, opt_size, "WxH", "output size, pixels; of each probe for an array"},
    {"centre", 'c', CLI_CALL, &cfg, opt_centre, "X,Y", "centre of the image circle, pixels from the top-left corner (default: the\npicture's), or auto: fit the circle"},
    {"radius", 'r', CLI_DOUBLE, &cfg.radius, NULL, "PX", "radius of the image circle (default: half the shorter side)"},
    {"falloff", 0, CLI_STRING, &cfg.falloff, NULL, "FILE", "divide by this brightness falloff (falloffcal's file, or polynomials)"},
    {"falloff-set", 0, CLI_STRING, &cfg.falloff_set, NULL, "NAME", "which set of a falloff file, such as f5.6"},
    {"aperture", 0, CLI_DOUBLE, &cfg.aperture, NULL, "N", "f-number that picks the falloff's set (default: the picture's)"},
    {"polar-max", 'p', CLI_DOUBLE, &cfg.polar_max_deg, NULL, "DEG", "polar angle at the probe's lower edge (default 90)"},
    {"rotate", 0, CLI_DOUBLE, &cfg.rotate_deg, NULL, "DEG", "turn the picture counter-clockwise about its centre first"},
    {"tilt", 0, CLI_DOUBLE, &cfg.tilt_deg, NULL, "DEG", "the camera's axis leans by this from the plane's normal"},
    {"tilt-to", 0, CLI_DOUBLE, &cfg.tilt_to_deg, NULL, "DEG", "towards this side of the (turned) picture, counter-clockwise from\nright (default 90: its top)"},
    {"from", 0, CLI_CALL, &cfg, opt_from, "VIEW", "what IN is: fisheye (default), ball, probe, latlong or angular"},
    {"to", 0, CLI_CALL, &cfg, opt_to, "VIEW", "what OUT shall be: probe (default), fisheye, ball, latlong or angular"},
    {"span", 0, CLI_DOUBLE, &cfg.span_deg, NULL, "DEG", "longitudes across a latlong picture (default 360)"},
    {"outside", 0, CLI_CALL, &cfg, opt_outside, "MODE", "directions that IN does not show: alpha (default; black, with an\nalpha channel), black, or hold (nearest in the column)"},
    {"filter", 0, CLI_CALL, &cfg, opt_filter, "NAME", "a texel's mean: area (default; its own), gaussian (0.5) or gaussian:SD (texels)"},
    {"overlay", 0, CLI_STRING, &cfg.overlay, NULL, "FILE.png", "write IN with the circles found, or given, drawn on it"},
    {"report", 0, CLI_STRING, &cfg.report, NULL, "FILE", "write what was found, and CPU times, as JSON"},
    {"mask", 'm', CLI_STRING, &cfg.mask, NULL, "FILE", "picture of IN's size; where it is black, IN is not used"},
    {"array", 'a', CLI_CALL, &cfg, opt_array, "NxM", "IN shows N x M mirror spheres; OUT is a light field"},
    {"corners", 0, CLI_CALL, &cfg, opt_corners, "LIST", "corner spheres \"X,Y,R X,Y,R X,Y,R X,Y,R\": (0,0), (N-1,0),\n(N-1,M-1), (0,M-1), or auto"},
    {"plane", 0, CLI_CALL, &cfg, opt_plane, "\"O U V\"", "nine numbers: the light field's origin and edge vectors\n(default: unit pitch from 0,0,0 along x and y)"},
    {"camera-distance", 0, CLI_DOUBLE, &cfg.camera_distance, NULL, "D", "camera to spheres, unit of --diameter (default: infinite)"},
    {"diameter", 0, CLI_DOUBLE, &cfg.diameter, NULL, "D", "sphere's diameter (default 1)"},
    {"reflectance", 0, CLI_CALL, &cfg, opt_reflectance, "R,G,B", "of the mirror spheres; the result is divided by it (default 1)"},
    {"hide-camera", 0, CLI_DOUBLE, &cfg.hide_camera_deg, NULL, "DEG", "leave out what a sphere reflects within DEG of the camera's direction"},
    {"second", 0, CLI_STRING, &cfg.second, NULL, "FILE", "another picture of the same ball, from elsewhere, to combine with IN"},
    {"second-view", 0, CLI_CALL, &cfg, opt_second, "X,Y,R,TILT,TO", "its ball, pixels, and its camera's --tilt and --tilt-to, degrees"},
    {"layer", 0, CLI_STRING, &cfg.layer, NULL, "NAME", "which layer, part or view of an OpenEXR picture that has several"},
    {"type", 't', CLI_CALL, &cfg, opt_type, "TYPE", "EXR pixels: float (default) or half"},
    {"compression", 0, CLI_STRING, &cfg.compression, NULL, "NAME", "EXR compression (default zip)"},
    {"output", 'o', CLI_STRING, &cfg.out, NULL, "OUT", "picture (.exr or .hdr), or .ilf.exr for an array; for several IN a name\nwith a % for theirs"},
    {0},
};

static const cli_prog prog = {
    "fishremap", "-o OUT IN...",
    "Remap a fisheye picture, a mirror ball or a mirror-sphere array to latitude/longitude light probes.", options,
    "Every output texel is a mean over its footprint in the picture, so that a lamp keeps its energy."};

static void check_usage(int operands)
{
    if (operands < 1) cli_fail(CLI_USAGE, "expected an input picture, found none");
    if (!cfg.out) cli_fail(CLI_USAGE, "expected -o OUT, found none");
    if (operands > 1 && (cfg.nu || !strchr(cfg.out, '%') || cfg.overlay))
        cli_fail(CLI_USAGE, "expected one input picture%s, found %d",
                 cfg.nu ? " of an array" : cfg.overlay ? " with --overlay" : ", or an OUT with a % for the pictures' names", operands);
    if (cfg.second && (cfg.from != VIEW_BALL || !(cfg.second_view[2] > 0)))
        cli_fail(CLI_USAGE, "expected --from ball and --second-view X,Y,R,TILT,TO with --second");
    if (!(cfg.hide_camera_deg >= 0 && cfg.hide_camera_deg < 90))
        cli_fail(CLI_USAGE, "--hide-camera: expected 0 to 90 degrees, found %g", cfg.hide_camera_deg);
    if (!cfg.out_w) cli_fail(CLI_USAGE, "expected --size WxH, found none");
    if (!cfg.nu && (cfg.from == VIEW_FISHEYE || cfg.to == VIEW_FISHEYE) && !cfg.lens)
        cli_fail(CLI_USAGE, "expected --lens MODEL, found none");
    if (cfg.nu && !cfg.corners_auto && !cfg.ncorners) cli_fail(CLI_USAGE, "expected --corners with --array, found none");
    if (cfg.nu * cfg.nv > 1 && !cfg.corners_auto && cfg.ncorners != 4)
        cli_fail(CLI_USAGE, "expected four corners for %dx%d spheres, found %d", cfg.nu, cfg.nv, cfg.ncorners);
    if (cfg.polar_max_deg < 0 || cfg.polar_max_deg > 180)
        cli_fail(CLI_USAGE, "--polar-max: expected an angle above 0 and up to 180 degrees, found %g", cfg.polar_max_deg);
    if (!(cfg.span_deg > 0 && cfg.span_deg <= 360))
        cli_fail(CLI_USAGE, "--span: expected an angle above 0 and up to 360 degrees, found %g", cfg.span_deg);
    if (cfg.radius < 0) cli_fail(CLI_USAGE, "--radius: expected pixels above 0, found %g", cfg.radius);
    if (!(cfg.diameter > 0)) cli_fail(CLI_USAGE, "--diameter: expected a length above 0, found %g", cfg.diameter);
    if (cfg.camera_distance < 0) cli_fail(CLI_USAGE, "--camera-distance: expected a length above 0, found %g", cfg.camera_distance);
}

/* OUT with its % replaced by the picture's name without folder and ending; malloc'd. */
static char *name_for(const char *out, const char *in)
{
    const char *base = strrchr(in, '/'), *mark = strchr(out, '%');
    base = base ? base + 1 : in;
    const char *dot = strrchr(base, '.');
    int len = dot && dot > base ? (int)(dot - base) : (int)strlen(base);
    char *name;
    if (asprintf(&name, "%.*s%.*s%s", (int)(mark - out), out, len, base, mark + 1) < 0) cli_fail(CLI_FAILED, "out of memory");
    return name;
}

static void tell(const outcome *o, const char *in, int several)
{
    const char *of = several ? in : "", *sep = several ? ": " : "";
    if (o->bad_pixels) cli_note("%s%s%lld pixels were not finite or masked and were left out", of, sep, (long long)o->bad_pixels);
    if (o->remark[0]) cli_note("%s%s%s", of, sep, o->remark);
}

int main(int argc, char **argv)
{
    errmsg e;
    outcome o = {0};
    session shared = {0};
    int n = cli_parse(&prog, argc, argv);
    check_usage(n);
    if (cfg.out_w > IMG_MAX_SIDE || cfg.out_h > IMG_MAX_SIDE || (int64_t)cfg.out_w * cfg.out_h > IMG_MAX_PIXELS / 4)
        cli_fail(CLI_FAILED, "--size: expected sides up to %d and up to %lld pixels, found %dx%d", IMG_MAX_SIDE, (long long)IMG_MAX_PIXELS / 4,
                 cfg.out_w, cfg.out_h);
    cfg.progress = cli_progress;
    cfg.command = cli_command_line(&prog, argc, argv);
    shared.several = n > 1;
    const char *out = cfg.out;
    for (int k = 1; k <= n; k++) {
        char *name = n > 1 ? name_for(out, argv[k]) : NULL;
        cfg.in = argv[k];
        if (name) cfg.out = name;
        o.bad_pixels = 0, o.remark[0] = 0;
        if (cfg.nu ? job_array(&o, &cfg, &e) : job_picture(&o, &shared, &cfg, &e)) cli_fail(CLI_FAILED, "%s", e.text);
        tell(&o, cfg.in, n > 1);
        if (n > 1) cli_progress("pictures", k, n);
        free(name);
    }
    session_free(&shared);
    if (cfg.report && report_write(cfg.report, &o, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    free(o.spheres);
    return cli_end(CLI_OK);
}
