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
#include "exportrad.h"
#include "output.h"
#include "picture.h"
#include "raysfile.h"
#include "report.h"
#include "taken.h"

enum { MOST_LAMPS = 64, MOST_EDITS = 256, MAX_WIDTH = 15 };

static const char *report, *rays, *radiance, *lamps, *geometry, *composed, *picture, *target, *exported,
    *edits[MOST_EDITS];
static storage stored = {.compression = "none"};
static int n_edits, grid_u, grid_v, dry_run;
#define NOT_GIVEN (-1e9)
#define DEGREE    57.29577951308232 /* in a radian */
static double max_width = NOT_GIVEN;

static int one_edit(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    if (n_edits == MOST_EDITS) return err_set(e, "expected at most %d changes", MOST_EDITS);
    edits[n_edits++] = value;
    return 0;
}

static int grid(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    return cli_parse_size(&grid_u, &grid_v, value, e);
}

static const cli_opt options[] = {
    {"output", 'o', CLI_STRING, &target, NULL, "OUT.ilf.exr",
     "write the light field, version 2: lamps, what hides them, and what is left in the probes"},
    {"type", 't', CLI_STRING, &stored.type, NULL, "half|float",
     "texels of OUT (default half where it holds them all, else float)"},
    {"compression", 'c', CLI_STRING, &stored.compression, NULL, "NAME",
     "of OUT's probes: none rle zips zip piz pxr24 b44 b44a (default none: renderers then share\nthe file's "
     "own bytes)"},
    {"interleave", 0, CLI_FLAG, &stored.interleave, NULL, NULL,
     "OUT holds the texels a second time, in the order that lookups like best"},
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
    {"dry-run", 0, CLI_FLAG, &dry_run, NULL, NULL, "check the options; read no light field, write nothing"},
    {"rays", 0, CLI_STRING, &rays, NULL, "FILE",
     "rays to evaluate: nine doubles each, as ilftrace's lines (with --radiance)"},
    {"radiance", 0, CLI_STRING, &radiance, NULL, "FILE",
     "their radiance: R G B floats by the input, then again by lamps and what is left"},
    {0}};

static const cli_prog prog = {"ilflamps", "IN.ilf.exr",
                              "Find the lamps of an incident light field and what hides them.", options,
                              "IN may be of version 2, too: then its lamps are as they are, to be changed "
                              "(--set), composed, shown.\n"};

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
    if (!target && !report && !rays && !composed && !picture && !exported)
        cli_fail(CLI_USAGE,
                 "nothing to write: expected -o, --compose, --report, --picture, --export-rad or --radiance");
    if (!target && (stored.type || stored.interleave || strcmp(stored.compression, "none") != 0))
        cli_fail(CLI_USAGE, "--type, --compression and --interleave are OUT's: expected -o, too");
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

    if (ilf_open(&file, path, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    const int version = ilf_get_info(file)->version;
    ilf_close(file);
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

    if (version_of(path) == ILF_FILE_VERSION) bad = analyse(a, path, &p, &e);
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
        /* probes between the old ones see what is left where it is */
        if (!bad && grid_u)
            bad = geometry ? surroundings_from(&a->around, geometry, &a->f, &e)
                           : surroundings_guess(&a->around, &a->f, &e);
    }
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

static void write_all(const analysis *a, const char *input, const char *line)
{
    errmsg e;
    int n = 0;

    if ((report && report_write(report, input, a, &e)) || (picture && picture_write(picture, a, &e)) ||
        (rays && rays_evaluate(radiance, rays, input, a, &e)) ||
        (composed &&
         compose_write(composed, a, grid_u ? grid_u : a->f.nu, grid_v ? grid_v : a->f.nv, line, &e)) ||
        (exported && exportrad_write(exported, a, line, &e)) ||
        (target && output_write(target, input, a, &stored, line, &n, &e)))
        cli_fail(CLI_FAILED, "%s", e.text);
    if (target && n == 0) cli_note("no lamp was taken out: %s is of version 1", target);
}

int main(int argc, char **argv)
{
    char *line = cli_command_line(&prog, argc, argv);
    const int n = cli_parse(&prog, argc, argv);
    analysis a;
    errmsg e;

    check_usage(n);
    check_options();
    if (dry_run) return cli_end(CLI_OK);
    get_lamps(&a, argv[1]);
    for (int k = 0; k < n_edits; k++)
        if (edit_lamp(&a, edits[k], &e)) cli_fail(CLI_USAGE, "%s", e.text);
    write_all(&a, argv[1], line);
    free(line);
    analysis_free(&a);
    return cli_end(CLI_OK);
}
