/*
 * ilflamps.c - find the lamps of a light field, take them out, and find out what hides or shapes each.
 */
#include <stdlib.h>
#include <string.h>

#include "analysis.h"
#include "base/cli.h"
#include "raysfile.h"
#include "report.h"

enum { MOST_LAMPS = 64 };

static const char *report, *rays, *radiance, *lamps, *geometry;
static double max_width = 15;

static const cli_opt options[] = {
    {"geometry", 0, CLI_STRING, &geometry, NULL, "FILE.oct", "the surroundings, any materials: rtrace tells how far they are (else a box is estimated from the probes)"},
    {"report", 0, CLI_STRING, &report, NULL, "FILE.json", "write what was found"},
    {"lamps", 0, CLI_STRING, &lamps, NULL, "keep|auto|N", "lamps to take out: none, all that can be explained (the default), or the N brightest"},
    {"max-width", 0, CLI_DOUBLE, &max_width, NULL, "DEG", "leave lamps in the field that look wider than this (default 15)"},
    {"rays", 0, CLI_STRING, &rays, NULL, "FILE", "rays to evaluate: nine doubles each, as ilftrace's lines (with --radiance)"},
    {"radiance", 0, CLI_STRING, &radiance, NULL, "FILE", "their radiance: R G B floats by the input, then again by lamps and what is left"},
    {0}};

static const cli_prog prog = {"ilflamps", "IN.ilf.exr", "Find the lamps of an incident light field and what hides them.", options, NULL};

static int how_many(void)
{
    char *end;

    if (!lamps || !strcmp(lamps, "auto")) return MOST_LAMPS;
    if (!strcmp(lamps, "keep")) return 0;
    const long n = strtol(lamps, &end, 10);
    if (*end || end == lamps || n < 0 || n > MOST_LAMPS)
        cli_fail(CLI_USAGE, "--lamps: expected keep, auto or a number up to %d, found \"%s\"", MOST_LAMPS, lamps);
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
    if (analyse(&a, argv[1], &p, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    if (report && report_write(report, argv[1], &a, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    if (rays && rays_evaluate(radiance, rays, argv[1], &a, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    analysis_free(&a);
    return cli_end(CLI_OK);
}
