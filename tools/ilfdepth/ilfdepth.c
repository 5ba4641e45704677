/*
 * ilfdepth - how far what the probes show is: maps of distances, and the surroundings as a mesh, to be the auxiliary geometry
 * of whoever has not measured the room.
 */
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "depthfile.h"
#include "meshfile.h"
#include "picture.h"
#include "process.h"
#include "report.h"

static const char *target, *scene, *field, *depths, *report, *picture, *list, *probes, *kind;
static double nearest;
static int width, things;

static const cli_opt options[] = {
    {"output", 'o', CLI_STRING, &target, NULL, "OUT.obj",
     "write the surroundings as a mesh, closed, in the scene's coordinates"},
    {"rad", 0, CLI_STRING, &scene, NULL, "OUT.rad",
     "write the mesh as Radiance polygons of the material ilf: auxiliary geometry"},
    {"field", 0, CLI_STRING, &field, NULL, "NAME.ilf.exr",
     "light field that OUT.rad names (default: the input; needed with --positions)"},
    {"depth", 0, CLI_STRING, &depths, NULL, "FILE.exr",
     "write a map of distances for each probe (channel Y, along the ray, scene's unit; confidence 0\nto 1; "
     "error, relative)"},
    {"report", 0, CLI_STRING, &report, NULL, "FILE.json", "write what was found, and how sure it is"},
    {"picture", 0, CLI_STRING, &picture, NULL, "FILE.png",
     "draw some probes, their distances and how sure those are"},
    {"positions", 0, CLI_STRING, &list, NULL, "FILE",
     "take panoramas in place of a light field: lines \"picture x y z heading [pitch roll]\" (degrees)"},
    {"probes", 0, CLI_STRING, &probes, NULL, "N|\"I,J ...\"",
     "probes of the light field to use: how many, or which (default: all, or 64 of more)"},
    {"surface", 0, CLI_STRING, &kind, NULL, "auto|box|mixed|free",
     "the mesh: a box, a box with what departs from it, distances alone, or what predicts left-out\nprobes "
     "best (the default)"},
    {"things", 0, CLI_FLAG, &things, NULL, NULL,
     "things that hang in the room stay in the mesh (mixed, free)"},
    {"near", 0, CLI_DOUBLE, &nearest, NULL, "DISTANCE",
     "nothing is nearer than this (default: 0.3 of the positions' extent)"},
    {"width", 0, CLI_INT, &width, NULL, "N",
     "columns of the maps that are swept (default: from the pictures)"},
    {0}};

static const cli_prog prog = {
    "ilfdepth",
    "IN.ilf.exr | --positions FILE",
    "Find how far the surroundings of a light field are, from the parallax between its probes.",
    options,
    "Of a light field of version 2 what is left in the probes is compared; its lamps stand where the "
    "file says.\n",
    NULL};

static int asked(void)
{
    if (!kind || !strcmp(kind, "auto")) return -1;
    for (int k = 0; k < SURFACE_FAR; k++)
        if (!strcmp(kind, judge_names[k])) return k;
    cli_fail(CLI_USAGE, "--surface: expected auto, box, mixed or free, found \"%s\"", kind);
}

static void check_usage(int operands)
{
    (void)asked();
    if (operands != !list)
        cli_fail(CLI_USAGE, "expected one light field, or --positions FILE, found %d light field%s%s",
                 operands, operands == 1 ? "" : "s", list ? " and --positions" : "");
    if (!target && !scene && !depths && !report && !picture)
        cli_fail(CLI_USAGE, "nothing to write: expected -o, --rad, --depth, --report or --picture");
    if (list && probes)
        cli_fail(CLI_USAGE, "--probes chooses among a light field's: with --positions leave lines out");
    if (list && scene && !field)
        cli_fail(CLI_USAGE, "--rad with --positions: expected --field, the light field that the scene names");
    if (nearest < 0) cli_fail(CLI_USAGE, "--near: expected more than 0, found %g", nearest);
    if (width && (width < 32 || width > 1024))
        cli_fail(CLI_USAGE, "--width: expected 32 to 1024, found %d", width);
}

/* What was assumed, and what is not sure. */
static void say(const process *q)
{
    certainty c;

    report_certainty(&c, &q->m, &q->s);
    if (q->v.rays)
        cli_note("surface: %s (left-out pictures differ from what it predicts by %.2f %%)",
                 judge_names[q->v.best], 100 * q->v.error[q->v.best]);
    else
        cli_note("surface: %s, not judged: expected 9 pictures or more, found %d", judge_names[q->v.best],
                 q->s.n);
    if (q->b.fitted && q->things > .002 && (!things || q->v.best == SURFACE_BOX))
        cli_note("%.1f %% of what is seen stands before the box, from %.3g on: it is not in the mesh",
                 100 * q->things, q->thing);
    cli_note("%.0f %% of the mesh is measured, to %.2g %% (median); %.0f %% only closes it", 100 * c.measured,
             100 * c.median, 100 * (1 - c.measured));
    if (q->v.rays && q->v.error[SURFACE_FAR] < 1.05 * q->v.error[q->v.best])
        cli_note("all is too far away for parallax: a source, infinitely far away, predicts left-out "
                 "pictures as well");
}

static void write_all(const process *q, const char *input, const char *line)
{
    errmsg e;

    if ((depths && depthfile_write(depths, q->maps, q->s.n, &q->s, line, &e)) ||
        (report && report_write(report, input, q, &e)) || (picture && picture_write(picture, q, &e)) ||
        (target && meshfile_obj(target, &q->m, line, &e)) ||
        (scene && meshfile_rad(scene, &q->m, field ? field : input, line, &e)))
        cli_fail(CLI_FAILED, "%s", e.text);
}

int main(int argc, char **argv)
{
    char *line = cli_command_line(&prog, argc, argv);
    const int n = cli_parse(&prog, argc, argv);
    process q = {0};
    errmsg e;

    check_usage(n);
    const process_plan plan = {nearest, width, asked(), things};
    if ((list ? views_of_list(&q.s, list, &e) : views_of_field(&q.s, argv[1], probes, &e)) ||
        process_run(&q, &plan, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
    say(&q);
    write_all(&q, list ? list : argv[1], line);
    free(line);
    process_free(&q);
    return cli_end(CLI_OK);
}
