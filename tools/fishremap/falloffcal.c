/*
 * falloffcal - the brightness falloff of a lens, from pictures of a constant diffuse source.
 *
 * This file owns the command line, the pictures and the messages; sourcedisc.c measures,
 * falloff_fit.c fits, falloff_write.c writes (paper, section 4.2 and figure 6).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "circle.h"
#include "falloff_write.h"
#include "image/image.h"
#include "lensfile.h"
#include "sourcedisc.h"

#define DEG          (M_PI / 180)
#define MAX_READINGS 4096

static struct {
    const char *lens, *out, *plot, *flat;
    double fov_deg, radius, centre[2];
    int have_centre, centre_auto, linear;
} cfg;

static int opt_centre(const char *v, void *arg, errmsg *e)
{
    (void)arg;
    cfg.centre_auto = strcmp(v, "auto") == 0;
    cfg.have_centre = !cfg.centre_auto;
    return cfg.centre_auto ? 0 : cli_parse_doubles(cfg.centre, 2, v, ",", e);
}

static const cli_opt options[] = {
    {"lens", 'l', CLI_STRING, &cfg.lens, NULL, "MODEL",
     "equidistant, equisolid, stereographic, orthographic, or a lens file"},
    {"fov", 'f', CLI_DOUBLE, &cfg.fov_deg, NULL, "DEG", "field of view of the image circle, degrees"},
    {"centre", 'c', CLI_CALL, NULL, opt_centre, "X,Y",
     "centre of the image circle, pixels (default: the picture's), or auto"},
    {"radius", 'r', CLI_DOUBLE, &cfg.radius, NULL, "PX",
     "radius of the image circle (default: half the shorter side)"},
    {"flat", 0, CLI_STRING, &cfg.flat, NULL, "IMAGE", "picture of a flat field, in place of IMAGE@DEG"},
    {"linear", 0, CLI_FLAG, &cfg.linear, NULL, NULL,
     "codes of PNG, JPEG, TIFF and PNM are proportional to light (default: sRGB)"},
    {"plot", 0, CLI_STRING, &cfg.plot, NULL, "FILE.svg", "plot of the readings and the curves"},
    {"output", 'o', CLI_STRING, &cfg.out, NULL, "FALLOFF", "text file that fishremap --falloff reads"},
    {0},
};

static const cli_choice choices[] = {
    {"lens", "equidistant equisolid stereographic orthographic FILE"},
    {"centre", "auto"},
    {0},
};

static const cli_prog prog = {
    "falloffcal",
    "-o FALLOFF IMAGE@DEG...",
    "Measure a lens's brightness falloff from pictures of a constant diffuse source at known angles.",
    options,
    "IMAGE@DEG: a picture and the source's angle from the optical axis, such as s05.exr@25.",
    choices};

/* Load as 4 channels of linear light and make the chart of its image circle; *white: its highest code, 0 if
 * it has none. */
static void load(img *im, double *white, chart *c, const lens *l, const char *path)
{
    errmsg e;
    img a;
    if (img_load(&a, path, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    *white = a.info.coded ? cfg.linear ? a.info.max_code : 1 : 0;
    if (!cfg.linear) img_linearise_srgb(&a);
    if (img_alloc(im, a.info.width, a.info.height, 4, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    size_t n = (size_t)a.info.width * (size_t)a.info.height, ch = (size_t)a.info.channels;
    for (size_t i = 0; i < n; i++) {
        const float *p = a.pix + i * ch;
        float *q = im->pix + 4 * i;
        q[0] = p[0], q[1] = ch >= 3 ? p[1] : p[0], q[2] = ch >= 3 ? p[2] : p[0], q[3] = 1;
    }
    img_free(&a);
    int w = im->info.width, h = im->info.height;
    static int first_w, first_h;
    if (!first_w) first_w = w, first_h = h;
    if (l->focal_px > 0 && (w != first_w || h != first_h))
        cli_fail(
            CLI_FAILED,
            "%s: expected pictures of one size with a camera matrix, %d x %d as the first, found %d x %d",
            path, first_w, first_h, w, h);
    double cx = w / 2., cy = h / 2.,
           r = cfg.radius > 0    ? cfg.radius
               : l->focal_px > 0 ? l->focal_px / l->scale
                                 : (w < h ? w : h) / 2.;
    if (l->focal_px > 0) cx = l->centre_px[0], cy = l->centre_px[1];
    if (cfg.have_centre) cx = cfg.centre[0], cy = cfg.centre[1];
    if (cfg.centre_auto) {
        circle_found f;
        if (circle_find(&f, im->pix, w, h, CIRCLE_LENS, cfg.radius, &e))
            cli_fail(CLI_FAILED, "%s: %s", path, e.text);
        cx = f.x, cy = f.y, r = cfg.radius > 0 ? cfg.radius : f.r;
    }
    if (cx + r < 0 || cy + r < 0 || cx - r > w || cy - r > h)
        cli_fail(
            CLI_FAILED,
            "%s: expected the image circle to reach into the picture (%d x %d), found centre %g,%g radius %g",
            path, w, h, cx, cy, r);
    chart_disc(c, w, h, l, cx, cy, r, 0, 0, 0, 0);
}

/* The top of one picture's source: where it is clipped. */
typedef struct seen_top {
    double deg, white, value[3],
        share[3]; /* white: of the highest code, 0 none; share: of the source's pixels at just that value */
} seen_top;

/* Code 240 of 255. */
static double near_white(void)
{
    return cfg.linear ? 240 / 255. : 0.871;
}

/* Clipped: more than a few pixels at the highest code; or a source whose pixels pile up at a code that two
 * others end at, too, though the falloff differs: a camera's white below the highest code.  Radiance has no
 * white: there a lens without falloff looks so. */
static int is_clipped(const seen_top *t, int n, int i)
{
    for (int c = 0; c < 3; c++) {
        double v = t[i].value[c];
        int alike = 0;
        if (t[i].white > 0 && v >= t[i].white * (1 - 1e-6) && t[i].share[c] > 0.02) return 1;
        /* bytes are coarse: an honest hump of a curve can end at one code in three pictures; only near the
         * top is that a white */
        if (t[i].share[c] < 0.3 || !(t[i].white > 0 && v > near_white() * t[i].white)) continue;
        for (int k = 0; k < n; k++) alike += t[k].value[c] == v && t[k].share[c] >= 0.3;
        int above = 0;
        for (int k = 0; k < n; k++) above |= t[k].value[c] > v;
        if (alike >= 3 && !above) return 1;
    }
    return 0;
}

static void refuse_clipped(const seen_top *t, int n)
{
    char list[400] = "";
    int count = 0;
    for (int i = 0; i < n; i++) {
        if (!is_clipped(t, n, i)) continue;
        size_t m = strlen(list);
        if (m + 40 < sizeof list) snprintf(list + m, sizeof list - m, "%s%g", count ? ", " : "", t[i].deg);
        else if (strcmp(list + m - 3, "...") != 0) strcpy(list + m, " ...");
        count++;
    }
    if (count)
        cli_fail(
            CLI_FAILED,
            "expected sources darker than white, found %d of %d readings clipped: at %s degrees; expose less",
            count, n, list);
}

/* One operand, IMAGE@DEG. */
static void read_operand(falloff_reading *r, seen_top *top, const lens *l, char *operand)
{
    errmsg e;
    double deg;
    char *at = strrchr(operand, '@');
    if (!at || cli_parse_double(&deg, at + 1, &e))
        cli_fail(CLI_USAGE, "expected IMAGE@DEG, found %s", operand);
    deg = fabs(deg);
    if (deg * DEG > l->half * (1 + 1e-9))
        cli_fail(CLI_FAILED,
                 "%s: expected an angle within the field of view (%.4g degrees from the axis), found %g",
                 operand, l->half / DEG, deg);
    *at = 0;
    img im;
    chart c;
    source_disc s;
    load(&im, &top->white, &c, l, operand);
    if (source_find(&s, im.pix, &c, deg * DEG, &e)) cli_fail(CLI_FAILED, "%s: %s", operand, e.text);
    const int elsewhere =
        fabs(s.theta - deg * DEG) > 12 * DEG; /* where source_find() does not even look: no source */
    if (fabs(s.theta - deg * DEG) > 5 * DEG)
        cli_note("%s: the source seems to stand at %.1f degrees, not at %g%s", operand, s.theta / DEG, deg,
                 elsewhere ? ": left out" : "");
    memset(r, 0, sizeof *r);
    /* what was averaged has angles of its own: a disc at the rim is cut, or hides half of itself; but a
     * source elsewhere than said is not believed */
    r->theta = fabs(s.theta - deg * DEG) < 1.5 * DEG ? s.mean_theta : deg * DEG;
    r->theta = fmin(r->theta, l->half);
    r->spread = s.spread;
    memcpy(top->value, s.top, sizeof top->value);
    memcpy(top->share, s.at_top, sizeof top->share);
    top->deg = deg;
    if (!elsewhere) memcpy(r->y, s.value, sizeof r->y);
    memcpy(r->sd, s.sd, sizeof r->sd);
    img_free(&im);
    *at = '@';
}

/* The lens, for pictures of the size of the first one (IMAGE or IMAGE@DEG). */
static void read_lens(lens *l, const char *first)
{
    errmsg e, none;
    img_info info = {0};
    char said[512], *path = strdup(first), *at = path && !cfg.flat ? strrchr(path, '@') : NULL;
    if (!path) cli_fail(CLI_FAILED, "out of memory");
    if (at) *at = 0;
    if (lens_kind_by_name(cfg.lens) < 0 && img_probe(&info, path, &none))
        info.width = info.height = 0; /* load() has the words */
    const lens_use use = {.fov_deg = cfg.fov_deg,
                          .width = info.width,
                          .height = info.height,
                          .placed = cfg.radius > 0,
                          .centre = cfg.have_centre ? cfg.centre : NULL};
    if (lens_read_for(l, said, cfg.lens, &use, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    if (said[0]) cli_note("%s", said);
    free(path);
}

int main(int argc, char **argv)
{
    errmsg e;
    lens l;
    falloff_curve f[3];
    int n = cli_parse(&prog, argc, argv), rings = 0;
    if (!cfg.lens) cli_fail(CLI_USAGE, "expected --lens MODEL, found none");
    if (!cfg.out) cli_fail(CLI_USAGE, "expected -o FALLOFF, found none");
    if (!n == !cfg.flat)
        cli_fail(CLI_USAGE, "expected either IMAGE@DEG... or --flat IMAGE, found %s", n ? "both" : "neither");
    if (n > MAX_READINGS) cli_fail(CLI_USAGE, "expected at most %d pictures, found %d", MAX_READINGS, n);
    read_lens(&l, cfg.flat ? cfg.flat : argv[1]);
    falloff_reading *r = calloc((size_t)n + 256, sizeof *r);
    seen_top *top = calloc((size_t)n + 1, sizeof *top);
    if (!r || !top) cli_fail(CLI_FAILED, "out of memory");
    char *command = cli_command_line(&prog, argc, argv);
    for (int i = 0; i < n; i++) {
        read_operand(r + i, top + i, &l, argv[1 + i]);
        cli_progress("measuring", i + 1, n);
    }
    refuse_clipped(top, n);
    free(top);
    if (cfg.flat) {
        img im;
        chart c;
        double white, clipped[3];
        load(&im, &white, &c, &l, cfg.flat);
        if (flat_clipped(clipped, im.pix, &c, white, &e)) cli_fail(CLI_FAILED, "%s: %s", cfg.flat, e.text);
        for (int k = 0; k < 3; k++)
            if (clipped[k] > 0)
                cli_fail(CLI_FAILED,
                         "%s: expected a flat field darker than white, found channel %c clipped at %g; "
                         "expose less",
                         cfg.flat, "RGB"[k], white > 0 ? clipped[k] / white : clipped[k]);
        if (flat_rings(r + n, &rings, 180, im.pix, &c, &e)) cli_fail(CLI_FAILED, "%s: %s", cfg.flat, e.text);
        img_free(&im);
    }
    n += rings;
    for (int c = 0; c < 3; c++)
        if (falloff_fit(&f[c], r, n, c, l.half, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    for (int c = 0; c < 3; c++)
        if (f[c].used < n)
            cli_note("%c: %d of %d readings did not fit and were left out", "RGB"[c], n - f[c].used, n);
    if (cfg.plot && falloff_plot(cfg.plot, f, r, n, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    if (falloff_write(cfg.out, f, r, n, command ? command : prog.name, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
    free(command);
    free(r);
    return cli_end(CLI_OK);
}
