/*
 * ilfpack.c - light probes, in i-fastest order, to one incident light field file.
 */
#include <math.h>
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "ilf.h"
#include "image.h"
#include "outfile.h"

#define PI 3.14159265358979323846

static int n_u, n_v, interleave;
static double plane[9], polar_max_deg, polar_valid_deg;
static const char *plane_text, *type_name = "half", *compression = "none", *target;

static int take_grid(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_size(&n_u, &n_v, value, e);
}

static const cli_opt options[] = {
    {"grid", 'g', CLI_CALL, NULL, take_grid, "NxM", "probes along u and along v"},
    {"plane", 'p', CLI_STRING, &plane_text, NULL, "\"O U V\"",
     "nine numbers: position of probe (0,0), then the edges U and V of the\nsampled rectangle, in the scene's unit"},
    {"type", 't', CLI_STRING, &type_name, NULL, "half|float", "texels in the file (default half)"},
    {"compression", 'c', CLI_STRING, &compression, NULL, "NAME",
     "none rle zips zip piz pxr24 b44 b44a (default none: renderers then\nshare the file's own bytes)"},
    {"interleave", 0, CLI_FLAG, &interleave, NULL, NULL,
     "hold the texels a second time, in the order that lookups like best:\ntwice the file, and faster where it is used in place"},
    {"polar-max", 0, CLI_DOUBLE, &polar_max_deg, NULL, "DEG",
     "polar angle at the probes' lower edge (default: as the first probe's\nilf:polarMax says, else 90)"},
    {"polar-valid", 0, CLI_DOUBLE, &polar_valid_deg, NULL, "DEG",
     "angle beyond which the probes are not to be used (default: as the\nfirst probe's ilf:polarValid says)"},
    {"output", 'o', CLI_STRING, &target, NULL, "OUT.ilf.exr", "file to write"},
    {0}};

static const cli_prog prog = {
    "ilfpack", "--grid NxM --plane \"O U V\" -o OUT.ilf.exr PROBE...",
    "Pack light probes into an incident light field.", options,
    "PROBEs are latitude/longitude maps of one size: OpenEXR, Radiance .hdr, PNG, JPEG, TIFF or PNM\n"
    "(8 and 16 bit pictures count as sRGB).  They come row by row: (0,0) (1,0) ... (N-1,M-1).\n"};

/* ---- what a probe's own header says ------------------------------------------------------------ */

typedef struct probe_facts {
    double polar_max, polar_valid, white_luminance; /* 0: not stated */
    char owner[256], cap_date[64];
} probe_facts;

static void silent(exr_const_context_t ctxt, exr_result_t code, const char *msg)
{
    (void)ctxt, (void)code, (void)msg;
}

static double float_attr(exr_context_t x, const char *name)
{
    const exr_attribute_t *a = NULL;

    if (exr_get_attribute_by_name(x, 0, name, &a) != EXR_ERR_SUCCESS || !a || a->type != EXR_ATTR_FLOAT) return 0;
    return isfinite(a->f) ? (double)a->f : 0;
}

static void string_attr(char *to, size_t room, exr_context_t x, const char *name)
{
    const exr_attribute_t *a = NULL;

    if (exr_get_attribute_by_name(x, 0, name, &a) != EXR_ERR_SUCCESS || !a || a->type != EXR_ATTR_STRING) return;
    (void)!snprintf(to, room, "%s", a->string->str);
}

static probe_facts read_facts(const char *path)
{
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    probe_facts f = {0};
    exr_context_t x;

    init.error_handler_fn = silent;
    if (exr_start_read(&x, path, &init) != EXR_ERR_SUCCESS) return f;
    f.polar_max = float_attr(x, "ilf:polarMax");
    f.polar_valid = float_attr(x, "ilf:polarValid");
    f.white_luminance = float_attr(x, "whiteLuminance");
    string_attr(f.owner, sizeof f.owner, x, "owner");
    string_attr(f.cap_date, sizeof f.cap_date, x, "capDate");
    exr_finish(&x);
    return f;
}

/* ---- probes -------------------------------------------------------------------------------------- */

/* Load a probe as RGB radiance.  Fails the program if it can't. */
static void load_probe(img *im, const char *path)
{
    errmsg err;

    if (img_load(im, path, &err) != 0) cli_fail(CLI_FAILED, "%s", err.text);
    img_linearise_srgb(im);
    const int ch = im->info.channels;
    if (ch == 3) return;
    const size_t n = (size_t)im->info.width * (size_t)im->info.height;
    img rgb;
    if (img_alloc(&rgb, im->info.width, im->info.height, 3, &err) != 0) cli_fail(CLI_FAILED, "%s: %s", path, err.text);
    for (size_t k = 0; k < n; k++)
        for (int c = 0; c < 3; c++) rgb.pix[3 * k + (size_t)c] = im->pix[k * (size_t)ch + (size_t)(ch < 3 ? 0 : c)];
    img_free(im);
    *im = rgb;
}

/* The header holds floats: say so where that moves a probe by more than a thousandth of the pitch. */
static void check_rounding(void)
{
    double worst = 0;

    for (int k = 0; k < 2; k++) {
        const double *edge = plane + 3 + 3 * k;
        const int n = k ? n_v : n_u;
        const double pitch = sqrt(edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]) / (n > 1 ? n - 1 : 1);
        for (int c = 0; c < 3; c++) {
            worst = fmax(worst, fabs((double)(float)plane[c] - plane[c]) / pitch);
            worst = fmax(worst, fabs((double)(float)edge[c] - edge[c]) / pitch);
        }
    }
    if (worst > 1e-3)
        cli_warn("--plane rounds to the header's floats, %.3g of a probe's pitch off: give the material the plane as 9 reals",
                 worst);
}

static void check_usage(int operands)
{
    ilf_frame frame;
    ilf_error bad;
    errmsg err;

    if (!n_u) cli_fail(CLI_USAGE, "expected --grid NxM");
    if (!plane_text) cli_fail(CLI_USAGE, "expected --plane \"O U V\"");
    if (cli_parse_doubles(plane, 9, plane_text, " ", &err) != 0) cli_fail(CLI_USAGE, "--plane: %s", err.text);
    if (ilf_frame_init(&frame, plane, plane + 3, plane + 6, NULL, &bad) != ILF_OK)
        cli_fail(CLI_USAGE, "--plane: %s", bad.text);
    if (!target) cli_fail(CLI_USAGE, "expected -o OUT.ilf.exr");
    if (strcmp(type_name, "half") != 0 && strcmp(type_name, "float") != 0)
        cli_fail(CLI_USAGE, "--type: expected half or float, found %s", type_name);
    if ((int64_t)n_u * n_v != operands)
        cli_fail(CLI_USAGE, "expected %lld probes (%dx%d), found %d", (long long)n_u * n_v, n_u, n_v, operands);
    check_rounding();
}

int main(int argc, char **argv)
{
    char *line = cli_command_line(&prog, argc, argv);
    const int n = cli_parse(&prog, argc, argv);
    ilf_writer *w = NULL;
    outfile *out = NULL;
    ilf_error err;
    errmsg words;

    check_usage(n);
    const probe_facts facts = read_facts(argv[1]);
    ilf_spec spec = {.n_u = n_u, .n_v = n_v, .compression = compression, .interleave = interleave, .comments = line, .name = target};
    spec.type = strcmp(type_name, "half") == 0 ? ILF_HALF : ILF_FLOAT;
    memcpy(spec.origin, plane, sizeof spec.origin);
    memcpy(spec.U, plane + 3, sizeof spec.U);
    memcpy(spec.V, plane + 6, sizeof spec.V);
    spec.polar_max = polar_max_deg > 0 ? polar_max_deg * PI / 180 : facts.polar_max > 0 ? facts.polar_max : PI / 2;
    spec.polar_valid = polar_valid_deg > 0 ? polar_valid_deg * PI / 180 : facts.polar_valid;
    spec.white_luminance = facts.white_luminance;
    if (facts.owner[0]) spec.owner = facts.owner;
    if (facts.cap_date[0]) spec.cap_date = facts.cap_date;

    for (int k = 0; k < n; k++) {
        const char *path = argv[1 + k];
        img im;

        load_probe(&im, path);
        if (k == 0) {
            spec.n_theta = im.info.width, spec.n_phi = im.info.height;
            if (out_begin(&out, target, &words) != 0) cli_fail(CLI_FAILED, "%s", words.text);
            if (ilf_writer_open(&w, out_path(out), &spec, &err) != ILF_OK)
                cli_fail(err.status == ILF_ERR_IO ? CLI_FAILED : CLI_USAGE, "%s", err.text);
        }
        if (im.info.width != spec.n_theta || im.info.height != spec.n_phi)
            cli_fail(CLI_FAILED, "%s: expected %dx%d pixels as the first probe has, found %dx%d", path, spec.n_theta,
                     spec.n_phi, im.info.width, im.info.height);
        if (ilf_writer_probe(w, im.pix, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s (from %s)", err.text, path);
        img_free(&im);
        cli_progress("packing", k + 1, n);
    }
    if (ilf_writer_close(w, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    if (out_commit(out, &words) != 0) cli_fail(CLI_FAILED, "%s", words.text);
    free(line);
    return cli_end(CLI_OK);
}
