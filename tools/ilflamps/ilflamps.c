/*
 * ilflamps.c - find the lamps of a light field, take them out, and find out what hides or shapes each.
 */
#include <stdlib.h>
#include <string.h>

#include "analysis.h"
#include "base/cli.h"
#include "compose.h"
#include "edit.h"
#include "picture.h"
#include "raysfile.h"
#include "report.h"

enum { MOST_LAMPS = 64, MOST_EDITS = 256 };

static const char *report, *rays, *radiance, *lamps, *geometry, *composed, *picture, *edits[MOST_EDITS];
static int n_edits, grid_u, grid_v;
static double max_width = 15;

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
    {"compose", 0, CLI_STRING, &composed, NULL, "OUT.ilf.exr",
     "write lamps and what is left as a light field of version 1: lamps as texels, behind what hides them"},
    {"grid", 0, CLI_CALL, NULL, grid, "NxM",
     "probes that --compose writes (default: as many as the input has)"},
    {"set", 0, CLI_CALL, NULL, one_edit, "K.PROPERTY[=VALUE]",
     "change lamp K of the report: K.gain=X, K.rgb=R,G,B (radiance) or K.off; may be repeated"},
    {"picture", 0, CLI_STRING, &picture, NULL, "FILE.png",
     "draw the plane with each lamp's light on it, measured and modelled, and a side view"},
    {"geometry", 0, CLI_STRING, &geometry, NULL, "FILE.oct",
     "the surroundings, any materials: rtrace tells how far they are (else a box is estimated from the "
     "probes)"},
    {"report", 0, CLI_STRING, &report, NULL, "FILE.json", "write what was found"},
    {"lamps", 0, CLI_STRING, &lamps, NULL, "keep|auto|N",
     "lamps to take out: none, all that can be explained (the default), or the N brightest"},
    {"max-width", 0, CLI_DOUBLE, &max_width, NULL, "DEG",
     "leave lamps in the field that look wider than this (default 15)"},
    {"rays", 0, CLI_STRING, &rays, NULL, "FILE",
     "rays to evaluate: nine doubles each, as ilftrace's lines (with --radiance)"},
    {"radiance", 0, CLI_STRING, &radiance, NULL, "FILE",
     "their radiance: R G B floats by the input, then again by lamps and what is left"},
    {0}};

static const cli_prog prog = {"ilflamps", "IN.ilf.exr",
                              "Find the lamps of an incident light field and what hides them.", options,
                              NULL};

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

int main(int argc, char **argv)
{
    const int n = cli_parse(&prog, argc, argv);
    plan p = {.most = how_many(), .max_width = max_width / 57.29577951308232, .octree = geometry};
    analysis a;
    errmsg e;

    if (n != 1) cli_fail(CLI_USAGE, "expected one light field, found %d", n);
    if (!rays != !radiance) cli_fail(CLI_USAGE, "--rays and --radiance go together");
    if (grid_u && !composed)
        cli_fail(CLI_USAGE, "--grid says how many probes --compose writes: expected --compose, too");
    if (max_width <= 0) cli_fail(CLI_USAGE, "--max-width: expected more than 0 degrees, found %g", max_width);
    if (!report && !rays && !composed && !picture)
        cli_fail(CLI_USAGE, "nothing to write: expected --compose, --report, --picture or --radiance");
    if (analyse(&a, argv[1], &p, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    for (int k = 0; k < n_edits; k++)
        if (edit_lamp(&a, edits[k], &e)) cli_fail(CLI_USAGE, "%s", e.text);
    char *line = cli_command_line(&prog, argc, argv);
    if ((report && report_write(report, argv[1], &a, &e)) || (picture && picture_write(picture, &a, &e)) ||
        (rays && rays_evaluate(radiance, rays, argv[1], &a, &e)) ||
        (composed &&
         compose_write(composed, &a, grid_u ? grid_u : a.f.nu, grid_v ? grid_v : a.f.nv, line, &e)))
        cli_fail(CLI_FAILED, "%s", e.text);
    free(line);
    analysis_free(&a);
    return cli_end(CLI_OK);
}
