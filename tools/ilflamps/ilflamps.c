/*
 * ilflamps.c - find the lamps of a light field, take them out, and find out what hides or shapes each.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "analysis.h"
#include "base/cli.h"
#include "compose.h"
#include "edit.h"
#include "export.h"
#include "exportrad.h"
#include "output.h"
#include "picture.h"
#include "programs/field_guard.h"
#include "raysfile.h"
#include "report.h"
#include "taken.h"

enum { MOST_LAMPS = 64, MOST_EDITS = 256, MOST_EXPORTS = 16, MAX_WIDTH = 15 };

static const char *report, *rays, *radiance, *lamps, *geometry, *composed, *picture, *target, *exported,
    *edits[MOST_EDITS], *exports[MOST_EXPORTS];
static storage stored;
static int n_edits, n_exports, grid_u, grid_v, dry_run, at_given;
static viewpoint from;
#define NOT_GIVEN (-1e9)
#define DEGREE    57.29577951308232 /* in a radian */
static double max_width = NOT_GIVEN, metres = NOT_GIVEN;
#define LARGEST_ERROR .002
static char *line; /* the command line, for files; here it is known to whoever looks for what is not freed */

static int one_edit(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    if (n_edits == MOST_EDITS) return err_set(e, "expected at most %d changes", MOST_EDITS);
    edits[n_edits++] = value;
    return 0;
}

static int one_export(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    if (n_exports == MOST_EXPORTS) return err_set(e, "expected at most %d files", MOST_EXPORTS);
    exports[n_exports++] = value;
    return export_check(value, e);
}

static int place(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    at_given = 1;
    return cli_parse_doubles(from.at, 3, value, ",", e);
}

static int grid(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_size(&grid_u, &grid_v, value, e);
}

/* auto, or how many along u and v */
static int probes(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    stored.fewer = 1;
    stored.few.nu = stored.few.nv = 0;
    return strcmp(value, "auto") ? cli_parse_size(&stored.few.nu, &stored.few.nv, value, e) : 0;
}

static int largest_error(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_share(&stored.few.error, .5, value, e);
}

static int tolerance(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_share(&stored.tolerance, .5, value, e);
}

static const cli_opt options[] = {
    {"output", 'o', CLI_STRING, &target, NULL, "OUT.ilf.exr",
     "write the light field, version 2: lamps, what hides them, and what is left in the probes"},
    {"type", 't', CLI_STRING, &stored.type, NULL, "half|float",
     "texels of OUT (default half where it holds them all, else float)"},
    {"compression", 'c', CLI_STRING, &stored.compression, NULL, "NAME",
     "of OUT's probes: none rle zips zip piz pxr24 b44 b44a (default none: renderers then share\nthe file's "
     "own bytes; with --tolerance: zip)"},
    {"tolerance", 0, CLI_CALL, NULL, tolerance, "SHARE",
     "round OUT's texels so that none is off by more than this (1% or .01): much smaller when compressed; "
     "what it "
     "does to irradiance is said"},
    {"interleave", 0, CLI_FLAG, &stored.interleave, NULL, NULL,
     "OUT holds the texels a second time, in the order that lookups like best"},
    {"probes", 0, CLI_CALL, NULL, probes, "auto|NxM",
     "OUT holds fewer probes: as few as keep irradiance within --error where probes were left out, or NxM"},
    {"error", 0, CLI_CALL, NULL, largest_error, "SHARE",
     "with --probes auto: the largest error of irradiance (default .2%)"},
    {"compose", 0, CLI_STRING, &composed, NULL, "OUT.ilf.exr",
     "write lamps and what is left as a light field of version 1: lamps as texels, behind what hides them"},
    {"grid", 0, CLI_CALL, NULL, grid, "NxM",
     "probes that --compose writes (default: as many as the input has)"},
    {"set", 0, CLI_CALL, NULL, one_edit, "K.PROPERTY[=VALUE]",
     "change lamp K of the report, and of OUT: K.gain=X, K.rgb=R,G,B (radiance) or K.off; may be repeated"},
    {"picture", 0, CLI_STRING, &picture, NULL, "FILE.png",
     "draw the plane with each lamp's light on it, measured and modelled, and a side view"},
    {"geometry", 0, CLI_STRING, &geometry, NULL, "FILE.oct",
     "the surroundings, any materials: rtrace tells how far they are (else a box is estimated from the "
     "probes)"},
    {"report", 0, CLI_STRING, &report, NULL, "FILE.json", "write what was found"},
    {"lamps", 0, CLI_STRING, &lamps, NULL, "keep|auto|N",
     "lamps to take out: none, all that can be explained (the default), or the N brightest"},
    {"max-width", 0, CLI_DOUBLE, &max_width, NULL, "DEG",
     "leave lamps in the field that look wider than this (default 15); lenses with a beam of their own may "
     "look half as wide again"},
    {"export-rad", 0, CLI_STRING, &exported, NULL, "DIR",
     "write lamps and what is left for Radiance programs without our patches: lamps.rad, panorama.rad, ..."},
    {"export", 0, CLI_CALL, NULL, one_export, "FILE.usda|.rad|.json",
     "write lamps and what is left for USD, for a Radiance without our patches, or every number of the "
     "lamps; may be "
     "repeated"},
    {"at", 0, CLI_CALL, NULL, place, "X,Y,Z",
     "place from which exported files see what is left, scene's coordinates (default: the plane's middle)"},
    {"metres", 0, CLI_DOUBLE, &metres, NULL, "X", "metres in the scene's unit, for exported files"},
    {"dry-run", 0, CLI_FLAG, &dry_run, NULL, NULL, "check the options; read no light field, write nothing"},
    {"rays", 0, CLI_STRING, &rays, NULL, "FILE",
     "rays to evaluate: nine doubles each, as ilftrace's lines (with --radiance)"},
    {"radiance", 0, CLI_STRING, &radiance, NULL, "FILE",
     "their radiance: R G B floats by the input, then again by lamps and what is left"},
    {0}};

static const cli_choice choices[] = {
    {"compression", "none rle zips zip piz pxr24 b44 b44a"},
    {0},
};

static const cli_prog prog = {"ilflamps",
                              "IN.ilf.exr",
                              "Find the lamps of an incident light field and what hides them.",
                              options,
                              "IN may be of version 2, too: then its lamps are as they are, to be changed "
                              "(--set), composed, shown.\n",
                              choices};

static int how_many(void)
{
    char *end;

    if (!lamps || !strcmp(lamps, "auto")) return MOST_LAMPS;
    if (!strcmp(lamps, "keep")) return 0;
    const long n = strtol(lamps, &end, 10);
    if (*end || end == lamps || n < 0 || n > MOST_LAMPS)
        cli_fail(CLI_USAGE, "--lamps: expected keep, auto or a number up to %d, found \"%s\"", MOST_LAMPS,
                 lamps);
    return (int)n;
}

static void check_usage(int operands)
{
    if (operands != 1) cli_fail(CLI_USAGE, "expected one light field, found %d", operands);
    if (!rays != !radiance) cli_fail(CLI_USAGE, "--rays and --radiance go together");
    if (grid_u && !composed)
        cli_fail(CLI_USAGE, "--grid says how many probes --compose writes: expected --compose, too");
    if (max_width <= 0 && max_width > NOT_GIVEN)
        cli_fail(CLI_USAGE, "--max-width: expected more than 0 degrees, found %g", max_width);
    if (!target && !report && !rays && !composed && !picture && !exported && !n_exports)
        cli_fail(CLI_USAGE, "nothing to write: expected -o, --compose, --report, --picture, --export, "
                            "--export-rad or --radiance");
    if (metres <= 0 && metres > NOT_GIVEN)
        cli_fail(CLI_USAGE, "--metres: expected more than 0, found %g", metres);
    if ((at_given || metres > 0) && !exported && !n_exports)
        cli_fail(CLI_USAGE,
                 "--at and --metres are for what is exported: expected --export or --export-rad, too");
    if (stored.few.error > 0 && (!stored.fewer || stored.few.nu))
        cli_fail(CLI_USAGE, "--error goes with --probes auto: expected that, too");
    if (stored.few.error <= 0) stored.few.error = LARGEST_ERROR;
    if (!target &&
        (stored.fewer || stored.type || stored.interleave || stored.compression || stored.tolerance > 0))
        cli_fail(CLI_USAGE,
                 "--type, --compression, --interleave, --tolerance and --probes are OUT's: expected -o, too");
}

/* What can be wrong before anything is read. */
static void check_options(void)
{
    errmsg e;

    (void)how_many();
    if (target && storage_check(&stored, &e)) cli_fail(CLI_USAGE, "%s", e.text);
    if (geometry && access(geometry, R_OK) != 0)
        cli_fail(CLI_FAILED, "--geometry: %s: %s", geometry, strerror(errno));
}

static int version_of(const char *path)
{
    ilf_error err;
    ilf *file;

    if (field_open(&file, path, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    const int version = ilf_get_info(file)->version;
    field_close(file);
    return version;
}

/* Lamps and what is left of the input: found, or as somebody found them before. */
static void get_lamps(analysis *a, const char *path)
{
    const plan p = {.most = how_many(),
                    .max_width = (max_width > 0 ? max_width : MAX_WIDTH) / DEGREE,
                    .octree = geometry};
    errmsg e;
    int bad;

    const int taken = version_of(path) != ILF_FILE_VERSION;
    if (!taken) bad = analyse(a, path, &p, &e);
    else {
        if (lamps || max_width > 0)
            cli_fail(CLI_USAGE,
                     "%s: expected a light field of version 1 for --lamps and --max-width, found lamps that "
                     "were taken out before",
                     path);
        if (rays)
            cli_fail(CLI_USAGE,
                     "%s: expected a light field of version 1 for --rays, which compares it with its lamps "
                     "taken out, found version 2",
                     path);
        bad = taken_read(a, path, &e);
    }
    /* probes between the old ones, and whoever looks from elsewhere, see what is left where it is */
    if (!bad && (n_exports || stored.fewer || (grid_u && taken)) && !a->around.far &&
        (geometry || a->f.n > 1))
        bad = geometry ? surroundings_from(&a->around, geometry, &a->f, &e)
                       : surroundings_guess(&a->around, &a->f, &e);
    if (bad) cli_fail(CLI_FAILED, "%s", e.text);
    if (a->steady.measured)
        cli_note("%s: its probes are turned by %.2g degrees (rms of %d that lamps could tell, each to %.1g): "
                 "put right where lamps were measured",
                 path, a->steady.turn * DEGREE, a->steady.measured, a->steady.sure * DEGREE);
    if (a->blur.lamps)
        cli_note("%s: its pictures are blurred by %.2g degrees (standard deviation; %d of its lamps say so: "
                 "misfit %.2g, "
                 "%.2g were they sharp): each lamp is measured as a whole",
                 path, a->blur.width * DEGREE, a->blur.lamps, a->blur.misfit, a->blur.sharp);
    taken_first(a);
}

static void write_exports(const analysis *a)
{
    errmsg e;

    from.metres = metres > 0 ? metres : 0;
    if (!at_given) look_from_middle(from.at, &a->f);
    if (exported && exportrad_write(exported, a, &from, line, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    for (int k = 0; k < n_exports; k++)
        if (export_write(exports[k], a, &from, line, &e)) cli_fail(CLI_FAILED, "%s", e.text);
}

static void write_all(const analysis *a, const char *input)
{
    errmsg e;
    int n = 0;

    if ((report && report_write(report, input, a, &e)) || (picture && picture_write(picture, a, &e)) ||
        (rays && rays_evaluate(radiance, rays, input, a, &e)) ||
        (composed &&
         compose_write(composed, a, grid_u ? grid_u : a->f.nu, grid_v ? grid_v : a->f.nv, line, &e)) ||
        (target && output_write(target, input, a, &stored, line, &n, &e)))
        cli_fail(CLI_FAILED, "%s", e.text);
    write_exports(a);
    if (target && n == 0) cli_note("no lamp was taken out: %s is of version 1", target);
}

int main(int argc, char **argv)
{
    line = cli_command_line(&prog, argc, argv);
    const int n = cli_parse(&prog, argc, argv);
    analysis a;
    errmsg e;

    check_usage(n);
    check_options();
    if (dry_run) return cli_end(CLI_OK);
    get_lamps(&a, argv[1]);
    for (int k = 0; k < n_edits; k++)
        if (edit_lamp(&a, edits[k], &e)) cli_fail(CLI_USAGE, "%s", e.text);
    write_all(&a, argv[1]);
    free(line);
    analysis_free(&a);
    return cli_end(CLI_OK);
}
