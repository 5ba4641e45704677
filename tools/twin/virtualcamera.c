/*
 * virtualcamera.c - the camera of the digital twin: what a fisheye sees from the stage's place, rendered
 * once per place, and one developed exposure of it per call.
 */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "ambientfile.h"
#include "base/cli.h"
#include "curvefile.h"
#include "develop.h"
#include "image/image.h"
#include "picture_out.h"
#include "stagectl/argwords.h"
#include "viewrender.h"

static struct {
    const char *octree, *out, *lens, *falloff, *response, *cache, *render_options, *rtrace;
    double plane[9], at[2], seconds, fov, full_scale, full_well, read_noise;
    int grid[2], node[2], size, bits, seed, no_noise, supersample, refine;
    int have_plane, have_grid, have_node, have_at;
} o = {.lens = "equidistant",
       .response = "linear",
       .render_options = "",
       .seconds = NAN,
       .fov = 185,
       .full_scale = 1,
       .full_well = 20000,
       .read_noise = 10,
       .size = 512,
       .bits = 8,
       .seed = 1,
       .supersample = 2,
       .refine = 16};

static int take_plane(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    o.have_plane = 1;
    return cli_parse_doubles(o.plane, 9, value, " ", e);
}

static int take_grid(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    o.have_grid = 1;
    return cli_parse_size(&o.grid[0], &o.grid[1], value, e);
}

static int take_node(const char *value, void *arg, errmsg *e)
{
    double v[2];
    (void)arg;
    o.have_node = 1;
    if (cli_parse_doubles(v, 2, value, ",", e) != 0) return -1;
    for (int a = 0; a < 2; a++) {
        if (v[a] != floor(v[a]) || fabs(v[a]) > 1e9)
            return err_set(e, "expected two whole numbers I,J, found '%s'", value);
        o.node[a] = (int)v[a];
    }
    return 0;
}

static int take_at(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    o.have_at = 1;
    return cli_parse_doubles(o.at, 2, value, ",", e);
}

static int take_seconds(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    if (cli_parse_double(&o.seconds, value, e) != 0) return -1;
    return o.seconds > 0 ? 0 : err_set(e, "expected a time above 0 s, found '%s'", value);
}

static const cli_opt opts[] = {
    {"octree", 0, CLI_STRING, &o.octree, NULL, "FILE", "scene, as made by oconv"},
    {"plane", 0, CLI_CALL, NULL, take_plane, "\"O U V\"",
     "sampled rectangle: nine reals, corner and two edges"},
    {"grid", 0, CLI_CALL, NULL, take_grid, "NxM", "grid nodes along U and V"},
    {"node", 0, CLI_CALL, NULL, take_node, "I,J", "stand at this grid node"},
    {"at", 0, CLI_CALL, NULL, take_at, "X,Y", "or at these lengths along U and V from O"},
    {"seconds", 0, CLI_CALL, NULL, take_seconds, "T", "exposure time; fractions like 1/60 too"},
    {"output", 'o', CLI_STRING, &o.out, NULL, "OUT", ".png, .ppm; .exr or .hdr: the radiance itself"},
    {"size", 0, CLI_INT, &o.size, NULL, "N", "pixels along each side (512)"},
    {"fov", 0, CLI_DOUBLE, &o.fov, NULL, "DEG", "field of view across the image circle (185)"},
    {"lens", 0, CLI_STRING, &o.lens, NULL, "NAME",
     "equidistant (default), equisolid, stereographic, orthographic"},
    {"supersample", 0, CLI_INT, &o.supersample, NULL, "K", "K x K rays a pixel (2)"},
    {"refine", 0, CLI_INT, &o.refine, NULL, "R", "R x R rays at edges of bright things (16); 0 = off"},
    {"falloff", 0, CLI_STRING, &o.falloff, NULL, "FILE", "brightness falloff: lines 'degrees R G B'"},
    {"response", 0, CLI_STRING, &o.response, NULL, "NAME",
     "linear (default), srgb, gamma:G or a file from hdrgen --save-response"},
    {"bits", 0, CLI_INT, &o.bits, NULL, "B", "bits per sample, 1..16 (8)"},
    {"full-scale", 0, CLI_DOUBLE, &o.full_scale, NULL, "R", "radiance that just saturates in 1 s (1)"},
    {"electrons", 0, CLI_DOUBLE, &o.full_well, NULL, "F", "full well in electrons (20000)"},
    {"read-noise", 0, CLI_DOUBLE, &o.read_noise, NULL, "E", "read noise in electrons rms (10)"},
    {"seed", 0, CLI_INT, &o.seed, NULL, "N", "seed of the noise (1)"},
    {"no-noise", 0, CLI_FLAG, &o.no_noise, NULL, NULL, "no photon and read noise"},
    {"cache", 0, CLI_STRING, &o.cache, NULL, "DIR", "keep renderings here for the next exposure"},
    {"render-options", 0, CLI_STRING, &o.render_options, NULL, "WORDS",
     "options for rtrace, e.g. \"-ab 2 -aa .1\""},
    {"rtrace", 0, CLI_STRING, &o.rtrace, NULL, "PROGRAM",
     "renderer (rtrace beside this program, else in PATH)"},
    {0}};

static const cli_choice choices[] = {
    {"lens", "equidistant equisolid stereographic orthographic"},
    {"response", "linear srgb FILE"},
    {0},
};

static const cli_prog prog = {
    .name = "virtualcamera",
    .operands = "--octree FILE --plane \"O U V\" --grid NxM --node I,J --seconds T -o OUT",
    .summary = "Render what a fisheye camera sees from the plane and develop one exposure of it.",
    .opts = opts,
    .choices = choices,
    .epilog = "The camera looks along U x V with +V up in the picture, so +U is to the left."};

/* rtrace of the same installation; it finds its function files by itself. */
static void find_rtrace(char path[PATH_MAX])
{
    ssize_t n = readlink("/proc/self/exe", path, PATH_MAX - 8);
    char *slash = NULL;
    if (n > 0) {
        path[n] = 0;
        slash = strrchr(path, '/');
    }
    if (slash) {
        strcpy(slash, "/rtrace");
        if (access(path, X_OK) == 0) return;
    }
    strcpy(path, "rtrace");
}

static void check_options(void)
{
    if (!o.octree) cli_fail(CLI_USAGE, "expected --octree FILE");
    if (!o.have_plane) cli_fail(CLI_USAGE, "expected --plane \"Ox Oy Oz Ux Uy Uz Vx Vy Vz\"");
    if (o.have_at == o.have_node) cli_fail(CLI_USAGE, "expected either --node I,J or --at X,Y");
    if (o.have_node && !o.have_grid) cli_fail(CLI_USAGE, "expected --grid NxM with --node");
    if (!o.out) cli_fail(CLI_USAGE, "expected -o OUT");
    if (o.supersample < 1 || o.supersample > 64)
        cli_fail(CLI_USAGE, "--supersample: expected 1..64, found %d", o.supersample);
    if (o.refine < 0 || o.refine > 256) cli_fail(CLI_USAGE, "--refine: expected 0..256, found %d", o.refine);
    if (o.bits < 1 || o.bits > 16) cli_fail(CLI_USAGE, "--bits: expected 1..16, found %d", o.bits);
    if (!(o.full_scale > 0))
        cli_fail(CLI_USAGE, "--full-scale: expected radiance above 0, found %g", o.full_scale);
    if (!(o.full_well >= 1 && o.full_well <= 1e9))
        cli_fail(CLI_USAGE, "--electrons: expected 1..1e9, found %g", o.full_well);
    if (!(o.read_noise >= 0))
        cli_fail(CLI_USAGE, "--read-noise: expected 0 or more electrons, found %g", o.read_noise);
}

static int is_radiance_map(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot && (!strcasecmp(dot, ".exr") || !strcasecmp(dot, ".hdr"));
}

static void set_response(development *d, curve3 *table)
{
    errmsg e;
    if (!strcmp(o.response, "linear")) d->response = RESPONSE_LINEAR;
    else if (!strcmp(o.response, "srgb")) d->response = RESPONSE_SRGB;
    else if (!strncmp(o.response, "gamma:", 6)) {
        d->response = RESPONSE_GAMMA;
        if (cli_parse_double(&d->gamma, o.response + 6, &e) != 0 || !(d->gamma >= 0.1 && d->gamma <= 10))
            cli_fail(CLI_USAGE, "--response: expected gamma:0.1 to gamma:10, found '%s'", o.response);
    } else {
        if (curve_load_response(table, o.response, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
        d->response = RESPONSE_TABLE;
        d->table = table;
    }
}

static void see(float *radiance, const fisheye *f, const camera_frame *c, const view_settings *s)
{
    char key[65];
    errmsg e;
    if (view_key(key, f, c, s, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
    if (o.cache) {
        int found = view_cached(radiance, f->size, o.cache, key, &e);
        if (found < 0) cli_fail(CLI_FAILED, "%s", e.text);
        if (found) return;
    }
    char remark[512];
    if (ambient_settle(remark, s->options, s->octree, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
    if (remark[0]) cli_warn("%s", remark);
    if (view_render(radiance, f, c, s, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
    if (o.cache && view_store(radiance, f->size, o.cache, key, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
}

static void write_radiance(float *radiance, int size, const char *made_by)
{
    errmsg e;
    img im = {.info = {.width = size, .height = size, .channels = 3}, .pix = radiance};
    img_write_opts w = {.type = IMG_FLOAT, .comment = made_by};
    if (img_write(&im, o.out, &w, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
}

int main(int argc, char **argv)
{
    errmsg e;
    char beside[PATH_MAX];
    fisheye f;
    camera_frame c;
    argwords words;
    curve3 falloff = {0}, table = {0};
    char *made_by = cli_command_line(&prog, argc, argv);

    if (cli_parse(&prog, argc, argv) > 0) cli_fail(CLI_USAGE, "expected options only, found '%s'", argv[1]);
    check_options();
    int map = is_radiance_map(o.out);
    if (!map && !picture_format(o.out))
        cli_fail(CLI_USAGE, "%s: expected a name that ends in .png, .ppm, .exr or .hdr", o.out);
    if (!map && isnan(o.seconds)) cli_fail(CLI_USAGE, "expected --seconds T");
    if (fisheye_make(&f, o.lens, o.fov, o.size, &e) != 0) cli_fail(CLI_USAGE, "%s", e.text);
    if ((o.have_node ? camera_at_node(&c, o.plane, o.grid, o.node, &e)
                     : camera_at_point(&c, o.plane, o.at, &e)) != 0)
        cli_fail(CLI_USAGE, "%s", e.text);
    if (argwords_split(&words, o.render_options, &e) != 0 || view_check_options(&words, &e) != 0)
        cli_fail(CLI_USAGE, "%s", e.text);
    development d = {.full_scale = o.full_scale,
                     .full_well = o.full_well,
                     .read_noise = o.read_noise,
                     .noise = !o.no_noise,
                     .bits = o.bits};
    set_response(&d, &table);
    if (o.falloff) {
        if (curve_load_falloff(&falloff, o.falloff, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
        d.falloff = &falloff;
    }
    if (!o.rtrace) find_rtrace(beside);
    view_settings s = {.rtrace = o.rtrace ? o.rtrace : beside,
                       .octree = o.octree,
                       .options = &words,
                       .supersample = o.supersample,
                       .refine = o.refine,
                       .processes = cli_threads > 1 ? cli_threads : 1};

    size_t n = (size_t)f.size * (size_t)f.size * 3;
    float *radiance = calloc(n, sizeof *radiance);
    uint16_t *code = map ? NULL : calloc(n, sizeof *code);
    if (!radiance || (!map && !code)) cli_fail(CLI_FAILED, "out of memory");
    see(radiance, &f, &c, &s);
    if (map) {
        write_radiance(radiance, f.size, made_by);
    } else {
        d.seed = develop_seed((uint64_t)o.seed, c.pos, o.seconds);
        develop(code, radiance, &f, &d, o.seconds);
        picture p = {.code = code, .width = f.size, .height = f.size, .bits = d.bits, .comment = made_by};
        if (picture_write(&p, o.out, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
    }
    free(code);
    free(radiance);
    free(made_by);
    argwords_free(&words);
    curve_free(&falloff);
    curve_free(&table);
    return cli_end(CLI_OK);
}
