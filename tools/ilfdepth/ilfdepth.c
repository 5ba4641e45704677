/*
 * ilfdepth - how far what the probes show is: maps of distances, and the surroundings as a mesh.
 */
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "depthfile.h"
#include "depthmap.h"
#include "box.h"
#include "feature.h"

static const char *list, *depths;
static double nearest;
static int width;

static const cli_opt options[] = {
    {"positions", 0, CLI_STRING, &list, NULL, "FILE", "panoramas"},
    {"depth", 0, CLI_STRING, &depths, NULL, "FILE.exr", "write maps"},
    {"near", 0, CLI_DOUBLE, &nearest, NULL, "DISTANCE", "nearest"},
    {"width", 0, CLI_INT, &width, NULL, "N", "columns"},
    {0}};
static const cli_prog prog = {"ilfdepth", "IN.ilf.exr", "How far.", options, ""};

int main(int argc, char **argv)
{
    char *line = cli_command_line(&prog, argc, argv);
    const int n = cli_parse(&prog, argc, argv);
    views s;
    errmsg e;
    (void)n;
    if (list ? views_of_list(&s, list, &e) : views_of_field(&s, argv[1], &e)) cli_fail(CLI_FAILED, "%s", e.text);
    sweep_plan p;
    sweep_plan_make(&p, &s, nearest, width);
    int *held = calloc((size_t)s.n, sizeof *held);
    p.held = held;
    if (feature_make(&s, 3.14159 / p.w, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    depthmap *m = calloc((size_t)s.n, sizeof *m);
    cli_note("%d x %d cells, %d levels, most %g, nodes %d", p.w, p.h, p.levels, p.most, s.v[0].nodes);
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < s.n; k++) {
        errmsg e1;
        if (depthmap_make(&m[k], k, &p, &e1) || depthmap_sweep(&m[k], &s, &p, &e1)) cli_fail(CLI_FAILED, "%s", e1.text);
    }
    box b;
    if (box_fit(&b, m, s.n, &s, &p, &e) || (b.fitted && box_compete(m, s.n, &b, &s, &p, &e))) cli_fail(CLI_FAILED, "%s", e.text);
    cli_note("box %d explains %.3f sides %.4f %.4f %.4f %.4f %.4f %.4f +- %.4f %.4f %.4f %.4f %.4f %.4f axis %.4f %.4f", b.fitted, b.explains, b.side[0], b.side[1], b.side[2], b.side[3], b.side[4], b.side[5], b.error[0], b.error[1], b.error[2], b.error[3], b.error[4], b.error[5], b.axis[0][1], b.axis[2][0]);
    if (depthfile_write(depths, m, s.n, &s, line, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    return cli_end(CLI_OK);
}
