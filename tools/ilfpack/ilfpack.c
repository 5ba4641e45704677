/*
 * ilfpack.c - light probes, in i-fastest order, to one incident light field file; pictures taken anywhere
 * (--positions) are freepack.c's.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/cli.h"
#include "base/outfile.h"
#include "freepack.h"
#include "ilf.h"
#include "ilflamps/rounding.h"
#include "image/holes.h"
#include "image/image.h"
#include "repack.h"

#define PI 3.14159265358979323846

static int n_u, n_v, interleave, fill_holes, ignore_alpha, dry_run;
static const char *positions, *geometry, *lamps, *report, *refine_text;
static double plane[9], polar_max_deg, polar_valid_deg, tolerance;
static const char *plane_text, *type_name, *compression, *target, *layer;
static ilf_loss loss;

static int take_grid(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_size(&n_u, &n_v, value, e);
}

static int take_tolerance(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_share(&tolerance, .5, value, e);
}

static const cli_opt options[] = {
    {"grid", 'g', CLI_CALL, NULL, take_grid, "NxM", "probes along u and along v"},
    {"plane", 'p', CLI_STRING, &plane_text, NULL, "\"O U V\"",
     "nine numbers: position of probe (0,0), then the edges U and V of the\nsampled rectangle, in the "
     "scene's unit"},
    {"type", 't', CLI_STRING, &type_name, NULL, "half|float",
     "texels in the file (default half; of a FIELD: as it has)"},
    {"compression", 'c', CLI_STRING, &compression, NULL, "NAME",
     "none rle zips zip piz pxr24 b44 b44a (default none: renderers then\nshare the file's own bytes; with "
     "--tolerance: zip)"},
    {"tolerance", 0, CLI_CALL, NULL, take_tolerance, "SHARE",
     "round texels so that none is off by more than this (1% or .01): much\nsmaller when compressed; what it "
     "does "
     "to irradiance is said"},
    {"interleave", 0, CLI_FLAG, &interleave, NULL, NULL,
     "hold the texels a second time, in the order that lookups like best:\ntwice the file, and faster where "
     "it is used in place"},
    {"positions", 0, CLI_STRING, &positions, NULL, "FILE",
     "the PROBEs are panoramas taken anywhere: lines \"picture x y z heading\n[pitch roll]\", scene's unit "
     "and "
     "degrees; --grid and --plane are what\nthey support if not given"},
    {"geometry", 0, CLI_STRING, &geometry, NULL, "FILE.oct",
     "with --positions: the surroundings, any materials: rtrace tells how\nfar they are (else a box is "
     "estimated "
     "from the pictures)"},
    {"lamps", 0, CLI_STRING, &lamps, NULL, "auto|keep",
     "with --positions: take lamps out (version 2; the default), or keep them\nin the probes (version 1)"},
    {"refine", 0, CLI_STRING, &refine_text, NULL, "auto|always|never",
     "with --positions: correct places, headings and gains by what the\npictures agree on: where that "
     "clearly helps "
     "(the default), always, never"},
    {"report", 0, CLI_STRING, &report, NULL, "FILE.json",
     "with --positions: write what was found: pictures, nodes, lamps"},
    {"polar-max", 0, CLI_DOUBLE, &polar_max_deg, NULL, "DEG",
     "polar angle at the probes' lower edge (default: as the first probe's\nilf:polarMax says, else 90)"},
    {"polar-valid", 0, CLI_DOUBLE, &polar_valid_deg, NULL, "DEG",
     "angle beyond which the probes are not to be used (default: as the\nfirst probe's ilf:polarValid says)"},
    {"fill-holes", 0, CLI_FLAG, &fill_holes, NULL, NULL,
     "continue what is around directions that a probe did not see (alpha 0);\nwithout it they are black, and "
     "their share is said"},
    {"ignore-alpha", 0, CLI_FLAG, &ignore_alpha, NULL, NULL,
     "take all texels for seen, whatever the probes' alpha says"},
    {"layer", 0, CLI_STRING, &layer, NULL, "NAME", "which layer, part or view of OpenEXR probes"},
    {"dry-run", 0, CLI_FLAG, &dry_run, NULL, NULL, "check the options; read no probe, write nothing"},
    {"output", 'o', CLI_STRING, &target, NULL, "OUT.ilf.exr", "file to write"},
    {0}};

static const cli_choice choices[] = {
    {"compression", "none rle zips zip piz pxr24 b44 b44a"},
    {0},
};

static const cli_prog prog = {
    "ilfpack",
    "--grid NxM --plane \"O U V\" -o OUT.ilf.exr PROBE... | --positions FILE -o OUT.ilf.exr [PANORAMA...] | "
    "-o OUT.ilf.exr FIELD",
    "Pack light probes into an incident light field.",
    options,
    "PROBEs are latitude/longitude maps of one size: OpenEXR, Radiance .hdr, PNG, JPEG, TIFF or PNM\n"
    "(8 and 16 bit pictures count as sRGB).  They come row by row: (0,0) (1,0) ... (N-1,M-1).\nWith "
    "--positions they are equirectangular panoramas (top row up, middle column forward, columns to the "
    "right), in any order.\nA FIELD is a light field, of version 1 or 2, that is to be written again: "
    "smaller "
    "(--tolerance), otherwise compressed (--compression, --type) or ordered (--interleave).\n",
    choices};

/* ---- what a probe's own header says ------------------------------------------------------------ */

typedef struct probe_facts {
    double polar_max, polar_valid, white_luminance; /* 0: not stated */
    char owner[256], cap_date[64];
    int panorama_like; /* twice as wide as high, and the header does not say that it is a probe */
} probe_facts;

static img_reader *open_probe(const char *path)
{
    /* rows and columns are angles, whatever shape a pixel has */
    const img_open_opts how = {.keep_aspect = 1, .layer = layer};
    img_reader *r;
    errmsg err;

    if (img_reader_open_as(&r, path, &how, &err) != 0) cli_fail(CLI_FAILED, "%s", err.text);
    return r;
}

static double number_fact(img_reader *r, const char *name)
{
    char text[64];

    if (!img_reader_fact(r, name, text, sizeof text)) return 0;
    const double v = strtod(text, NULL);
    return isfinite(v) ? v : 0;
}

/* What a probe's header states; refuses what states that it is none. */
static probe_facts read_facts(img_reader *r, const char *path)
{
    probe_facts f = {.polar_max = number_fact(r, "ilf:polarMax"),
                     .polar_valid = number_fact(r, "ilf:polarValid"),
                     .white_luminance = number_fact(r, "whiteLuminance")};
    char kind[64];

    (void)img_reader_fact(r, "owner", f.owner, sizeof f.owner);
    (void)img_reader_fact(r, "capDate", f.cap_date, sizeof f.cap_date);
    const int chart = img_reader_fact(r, "ilf:chart", kind, sizeof kind);
    if (chart && strcmp(kind, "probe") != 0)
        cli_fail(CLI_FAILED,
                 "%s: expected a probe, found a picture whose header says %.40s (fishremap --from %.40s "
                 "makes a probe of it)",
                 path, kind, kind);
    if (img_reader_fact(r, "ilf:version", kind, sizeof kind))
        cli_fail(CLI_FAILED, "%s: expected a probe, found a light field by its header (ilf:version)", path);
    if (img_reader_info(r)->panorama && f.polar_max <= 0 && polar_max_deg <= 0)
        cli_fail(CLI_FAILED,
                 "%s: expected a probe, found an equirectangular panorama by its header (fishremap --from "
                 "latlong makes a "
                 "probe of it; --polar-max says that it is one)",
                 path);
    if (img_reader_info(r)->panorama && f.polar_max <= 0)
        cli_note("%s: packed as a probe although its header says that it is an equirectangular panorama",
                 path);
    const img_info *in = img_reader_info(r);
    f.panorama_like = !chart && f.polar_max <= 0 && !in->panorama && in->width == 2 * in->height;
    return f;
}

/* ---- probes -------------------------------------------------------------------------------------- */

typedef struct probe {
    int w, h;
    float *rgb, *seen; /* seen: NULL without alpha */
    holes gaps;        /* with alpha */
} probe;

static void probe_free(probe *p)
{
    free(p->rgb);
    free(p->seen);
}

/* Load a probe as RGB radiance and what of it was seen.  Fails the program if it can't. */
static void load_probe(probe *p, const char *path, double polar_max)
{
    img_reader *r = open_probe(path);
    img im = {.info = *img_reader_info(r)};
    const int ch = im.info.channels, alpha = (ch == 2 || ch == 4) && !ignore_alpha;
    const int rim = !im.info.cropped; /* of a lens; not the edge of a data window */
    const size_t n = (size_t)im.info.width * (size_t)im.info.height;
    errmsg err;

    *p = (probe){im.info.width,
                 im.info.height,
                 calloc(n, 3 * sizeof(float)),
                 alpha ? calloc(n, sizeof(float)) : NULL,
                 {0}};
    im.pix = calloc(n, (size_t)ch * sizeof(float));
    if (!im.pix || !p->rgb || (alpha && !p->seen)) cli_fail(CLI_FAILED, "%s: out of memory", path);
    if (img_reader_rows(r, im.pix, p->h, &err) != 0) cli_fail(CLI_FAILED, "%s", err.text);
    img_reader_close(r);
    img_linearise_srgb(&im);
    for (size_t k = 0; k < n; k++) {
        const float *from = im.pix + k * (size_t)ch, share = alpha ? from[ch - 1] : 1;
        if (alpha) p->seen[k] = share;
        for (size_t c = 0; c < 3 && share > 0; c++)
            p->rgb[3 * k + c] = from[ch < 3 ? 0 : c]; /* else it stays black */
    }
    img_free(&im);
    if (alpha) p->gaps = holes_find(p->seen, p->w, p->h, polar_max, rim);
    if (alpha && p->gaps.rows == 0)
        cli_fail(CLI_FAILED,
                 "%s: expected a probe that sees something, found alpha 0 everywhere (--ignore-alpha takes "
                 "its light as it is)",
                 path);
}

/* ---- directions that were not seen ----------------------------------------------------------------- */

typedef struct unseen {
    double edge; /* the smallest angle at which a probe stops seeing; polar_max: none does before it */
    const char *edge_of; /* that probe */
    int differ;          /* others see further */
    double sum, most;    /* holes: shares of all probes added up, the largest one */
    const char *most_of;
} unseen;

/* One look through all probes that have alpha; costs nothing where none has. */
static unseen find_unseen(char *const *paths, int n, double polar_max)
{
    unseen u = {.edge = polar_max};
    double least = polar_max, furthest = 0;

    for (int k = 0; k < n; k++) {
        img_reader *r = open_probe(paths[k]);
        const int ch = img_reader_info(r)->channels;
        img_reader_close(r);
        probe p;
        double edge = polar_max;
        if ((ch == 2 || ch == 4) && !ignore_alpha) {
            load_probe(&p, paths[k], polar_max);
            edge = p.gaps.edge;
            if (edge < least) least = edge, u.edge_of = paths[k];
            u.sum += p.gaps.among;
            if (p.gaps.among > u.most) u.most = p.gaps.among, u.most_of = paths[k];
            probe_free(&p);
        }
        furthest = fmax(furthest, edge);
    }
    u.edge = least;
    u.differ = furthest - least > 1e-6;
    return u;
}

static void say_unseen(const unseen *u, double polar_max, double valid, int n)
{
    const double deg = 180 / PI;

    if (u->edge < polar_max && valid > u->edge + 1e-6)
        cli_note("%s: seen all round to %.4g degrees only, but to be valid to %.4g: the last values seen are "
                 "held there",
                 u->edge_of, u->edge * deg, valid * deg);
    else if (u->edge < polar_max)
        cli_note("%s%s: seen all round to %.4g degrees only (alpha 0 beyond, %.3g %% of the solid angle): "
                 "ilf:polarValid is %.4g",
                 u->edge_of,
                 u->differ ? " sees least"
                 : n > 1   ? " and the others"
                           : "",
                 u->edge * deg, 100 * (cos(u->edge) - cos(polar_max)) / (1 - cos(polar_max)), valid * deg);
    if (u->most > 0)
        cli_note("%s: holes (alpha 0) of %.3g %% of the solid angle%s%s", u->most_of, 100 * u->most,
                 n > 1 ? ", the most of all probes; " : "; ",
                 fill_holes ? "filled from around them" : "black in the light field (--fill-holes)");
}

/* Values below 0 are kept (see ilf.h): say how many there are, and how far below. */
static struct {
    int64_t n, all;
    double least;
} below_zero;

static void look_below_zero(const probe *p)
{
    const size_t n = (size_t)p->w * (size_t)p->h * 3;

    below_zero.all += (int64_t)n;
    for (size_t k = 0; k < n; k++)
        if (p->rgb[k] < 0) {
            below_zero.n++;
            below_zero.least = fmin(below_zero.least, (double)p->rgb[k]);
        }
}

/* Does a probe hold more than a half can? */
static int beyond_half(const probe *p)
{
    const size_t n = (size_t)p->w * (size_t)p->h * 3;

    for (size_t k = 0; k < n; k++)
        if (fabsf(p->rgb[k]) > 65504.f && isfinite(p->rgb[k])) return 1;
    return 0;
}

/* The header holds floats: say so where that moves a probe by more than a thousandth of the pitch. */
static void check_rounding(void)
{
    double worst = 0;

    for (int k = 0; k < 2; k++) {
        const double *edge = plane + 3 + 3 * k;
        const int n = k ? n_v : n_u;
        const double pitch =
            sqrt(edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]) / (n > 1 ? n - 1 : 1);
        for (int c = 0; c < 3; c++) {
            worst = fmax(worst, fabs((double)(float)plane[c] - plane[c]) / pitch);
            worst = fmax(worst, fabs((double)(float)edge[c] - edge[c]) / pitch);
        }
    }
    if (worst > 1e-3)
        cli_warn("--plane rounds to the header's floats, %.3g of a probe's pitch off: give the material the "
                 "plane as 9 reals",
                 worst);
}

static void check_storage(void)
{
    if (!target) cli_fail(CLI_USAGE, "expected -o OUT.ilf.exr");
    if (type_name && strcmp(type_name, "half") != 0 && strcmp(type_name, "float") != 0)
        cli_fail(CLI_USAGE, "--type: expected half or float, found %s", type_name);
}

static void check_common(void)
{
    ilf_frame frame;
    ilf_error bad;
    errmsg err;

    if (plane_text && cli_parse_doubles(plane, 9, plane_text, " ", &err) != 0)
        cli_fail(CLI_USAGE, "--plane: %s", err.text);
    if (plane_text && ilf_frame_init(&frame, plane, plane + 3, plane + 6, NULL, &bad) != ILF_OK)
        cli_fail(CLI_USAGE, "--plane: %s", bad.text);
    check_storage();
}

static ilf_type texel_type(void)
{
    return type_name && strcmp(type_name, "float") == 0 ? ILF_FLOAT : ILF_HALF;
}

static const char *texel_compression(void)
{
    return compression ? compression : rounding_compression(tolerance, interleave);
}

static void check_usage(int operands)
{
    if (geometry || lamps || report || refine_text)
        cli_fail(CLI_USAGE,
                 "--geometry, --lamps, --refine and --report go with --positions: expected that, too");
    if (!n_u) cli_fail(CLI_USAGE, "expected --grid NxM");
    if (!plane_text) cli_fail(CLI_USAGE, "expected --plane \"O U V\"");
    check_common();
    if (!dry_run && (int64_t)n_u * n_v != operands)
        cli_fail(CLI_USAGE, "expected %lld probes (%dx%d), found %d", (long long)n_u * n_v, n_u, n_v,
                 operands);
    check_rounding();
}

/* The first probe's facts count; another's polar maximum must not contradict them. */
static probe_facts read_all_facts(char *const *paths, int n)
{
    probe_facts first = {0};

    for (int k = 0; k < n; k++) {
        img_reader *r = open_probe(paths[k]);
        const probe_facts f = read_facts(r, paths[k]);
        img_reader_close(r);
        if (k == 0) first = f;
        const double want = first.polar_max > 0 ? first.polar_max : PI / 2;
        if (polar_max_deg <= 0 && f.polar_max > 0 && fabs(f.polar_max - want) > 1e-4)
            cli_fail(CLI_FAILED, "%s: expected ilf:polarMax %.6g as in %s, found %.6g", paths[k], want,
                     paths[0], f.polar_max);
    }
    return first;
}

/* Below what was seen the last values hold, as lookups do beyond polarValid; holes are filled if the user
 * says so. */
static void complete_probe(probe *p, const char *path, double polar_max)
{
    if (!p->seen) return;
    if (fill_holes && holes_fill(p->rgb, p->seen, p->w, p->gaps.rows, polar_max * p->gaps.rows / p->h) != 0)
        cli_fail(CLI_FAILED, "%s: out of memory", path);
    holes_hold(p->rgb, p->seen, p->w, p->h, p->gaps.rows);
}

/* ---- pictures taken anywhere ------------------------------------------------------------------------ */

static void check_free(void)
{
    ilf_spec spec = {.n_u = 1, .n_v = 1, .n_theta = 8, .n_phi = 4, .U = {1}, .V = {0, 1}, .polar_max = 1};
    ilf_error err;

    check_common();
    if (polar_valid_deg > 0)
        cli_fail(CLI_USAGE, "--polar-valid is for probes on a grid, not for --positions");
    if (lamps && strcmp(lamps, "auto") != 0 && strcmp(lamps, "keep") != 0)
        cli_fail(CLI_USAGE, "--lamps: expected auto or keep, found \"%s\"", lamps);
    if (geometry && access(geometry, R_OK) != 0)
        cli_fail(CLI_FAILED, "--geometry: %s: %s", geometry, strerror(errno));
    spec.compression = texel_compression(), spec.interleave = interleave, spec.name = target;
    if (ilf_spec_check(&spec, &err) != ILF_OK) cli_fail(CLI_USAGE, "%s", err.text);
}

static const char *const REFINING[] = {"auto", "always", "never"};

static refining how_to_refine(void)
{
    for (int k = 0; k < 3; k++)
        if (!refine_text || strcmp(refine_text, REFINING[k]) == 0) return (refining)k;
    cli_fail(CLI_USAGE, "--refine: expected auto, always or never, found \"%s\"", refine_text);
}

static void pack_free(char *const *pictures, int n, const char *line)
{
    const freeplan p = {.positions = positions,
                        .plane = plane_text ? plane : NULL,
                        .n_u = n_u,
                        .n_v = n_v,
                        .octree = geometry,
                        .keep_lamps = lamps && strcmp(lamps, "keep") == 0,
                        .refine = how_to_refine(),
                        .how = {.polar_max = fmax(0, polar_max_deg) * PI / 180,
                                .ignore_alpha = ignore_alpha,
                                .layer = layer,
                                .most_rows = 1024},
                        .report = report,
                        .target = target,
                        .type = texel_type(),
                        .compression = texel_compression(),
                        .interleave = interleave,
                        .tolerance = tolerance,
                        .line = line};
    errmsg e;

    check_free();
    if (dry_run ? freepack_check(&p, pictures, n, &e) : freepack(&p, pictures, n, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
}

/* ---- a light field again ---------------------------------------------------------------------------- */

static int wants_field(char *const *paths, int n)
{
    return n == 1 && !n_u && !plane_text && repack_is_field(paths[0]);
}

static void pack_field(const char *source, const char *line)
{
    const repackplan p = {.source = source,
                          .target = target,
                          .type = type_name,
                          .compression = compression,
                          .interleave = interleave,
                          .tolerance = tolerance,
                          .line = line};
    errmsg e;

    check_storage();
    if (polar_max_deg > 0 || polar_valid_deg > 0 || fill_holes || ignore_alpha || layer || geometry ||
        lamps || report || refine_text)
        cli_fail(
            CLI_USAGE,
            "%s: a light field is written again with --type, --compression, --interleave and --tolerance: "
            "expected no other option",
            source);
    if (repack(&p, dry_run, &e)) cli_fail(CLI_FAILED, "%s", e.text);
}

int main(int argc, char **argv)
{
    char *line = cli_command_line(&prog, argc, argv);
    const int n = cli_parse(&prog, argc, argv);
    ilf_writer *w = NULL;
    outfile *out = NULL;
    ilf_error err;
    errmsg words;

    if (positions) {
        pack_free(argv + 1, n, line);
        free(line);
        return cli_end(CLI_OK);
    }
    if (wants_field(argv + 1, n)) {
        pack_field(argv[1], line);
        free(line);
        return cli_end(CLI_OK);
    }
    check_usage(n);
    const probe_facts facts = dry_run ? (probe_facts){0} : read_all_facts(argv + 1, n);
    ilf_spec spec = {.n_u = n_u,
                     .n_v = n_v,
                     .compression = texel_compression(),
                     .interleave = interleave,
                     .comments = line,
                     .name = target,
                     .tolerance = tolerance,
                     .loss = &loss};
    spec.type = texel_type();
    memcpy(spec.origin, plane, sizeof spec.origin);
    memcpy(spec.U, plane + 3, sizeof spec.U);
    memcpy(spec.V, plane + 6, sizeof spec.V);
    spec.polar_max = polar_max_deg > 0     ? polar_max_deg * PI / 180
                     : facts.polar_max > 0 ? facts.polar_max
                                           : PI / 2;
    const unseen u = dry_run ? (unseen){.edge = spec.polar_max} : find_unseen(argv + 1, n, spec.polar_max);
    spec.polar_valid = polar_valid_deg > 0 ? polar_valid_deg * PI / 180 : facts.polar_valid;
    if (polar_valid_deg <= 0 && u.edge < (spec.polar_valid > 0 ? spec.polar_valid : spec.polar_max))
        spec.polar_valid = u.edge;
    say_unseen(&u, spec.polar_max, spec.polar_valid, n);
    spec.white_luminance = facts.white_luminance;
    if (facts.owner[0]) spec.owner = facts.owner;
    if (facts.cap_date[0]) spec.cap_date = facts.cap_date;
    if (dry_run) {
        spec.n_theta = 64, spec.n_phi = 32; /* probes of any size will do */
        if (ilf_spec_check(&spec, &err) != ILF_OK) cli_fail(CLI_USAGE, "%s", err.text);
        return cli_end(CLI_OK);
    }

    for (int k = 0; k < n; k++) {
        const char *path = argv[1 + k];
        probe p;

        load_probe(&p, path, spec.polar_max);
        complete_probe(&p, path, spec.polar_max);
        if (k == 0) {
            spec.n_theta = p.w, spec.n_phi = p.h;
            if (out_begin(&out, target, &words) != 0) cli_fail(CLI_FAILED, "%s", words.text);
            if (ilf_writer_open(&w, out_path(out), &spec, &err) != ILF_OK)
                cli_fail(err.status == ILF_ERR_ARG ? CLI_USAGE : CLI_FAILED, "%s", err.text);
        }
        if (p.w != spec.n_theta || p.h != spec.n_phi)
            cli_fail(CLI_FAILED, "%s: expected %dx%d pixels as the first probe has, found %dx%d", path,
                     spec.n_theta, spec.n_phi, p.w, p.h);
        if (ilf_writer_probe(w, p.rgb, &err) != ILF_OK)
            cli_fail(CLI_FAILED, "%s (from %s)%s", err.text, path,
                     spec.type == ILF_HALF && beyond_half(&p) ? "; --type float holds it" : "");
        look_below_zero(&p);
        probe_free(&p);
        cli_progress("packing", k + 1, n);
    }
    if (ilf_writer_close(w, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    if (out_commit(out, &words) != 0) cli_fail(CLI_FAILED, "%s", words.text);
    if (facts.panorama_like)
        cli_note("%s: its header does not say what it is: taken for a probe, the normal along its upper "
                 "edge, %.4g degrees from "
                 "it at the lower one (a panorama would come out mirrored: fishremap --from latlong makes a "
                 "probe of it)",
                 argv[1], spec.polar_max * 180 / PI);
    if (tolerance > 0) rounding_say(&loss, target, 0);
    if (below_zero.n)
        cli_note("%s: %lld of %lld values are below 0, down to %.3g: kept, and looked up as they are", target,
                 (long long)below_zero.n, (long long)below_zero.all, below_zero.least);
    free(line);
    return cli_end(CLI_OK);
}
