/*
 * ilfview.c - a light field as a page to look at: one file, no server, no network.
 *
 * The page is plain WebGL2 of our own, not three.js: what it draws is one triangle that covers the screen,
 * whose pixels look rays up as FORMAT.md says.  A library of meshes, cameras and lights has nothing to add to
 * that, would put 0.7 MB into each page, and node and npm into each build.  The same program text gives
 * colours and, as whole numbers of 32 bits (which every WebGL2 can draw to), the values under the pointer: so
 * what is read is what is seen.
 */
#include <stdio.h>
#include <stdlib.h>

#include "base/cli.h"
#include "base/outfile.h"
#include "page.h"

enum { MOST_FILES = 2 };

static double size_mb = 20;
static const char *output;
static surface_given geometry;
static int geometry_given;

static int one_geometry(const char *value, void *arg, errmsg *e)
{
    (void)arg;
    geometry_given = 1;
    return surface_parse(&geometry, value, e);
}

static const cli_opt options[] = {
    {"output", 'o', CLI_STRING, &output, NULL, "VIEW.html", "write the page"},
    {"size-mb", 0, CLI_DOUBLE, &size_mb, NULL, "MB",
     "the page's largest size (default 20 megabytes): probes are made smaller until it fits"},
    {"geometry", 0, CLI_CALL, NULL, one_geometry, "WORDS",
     "auxiliary geometry to begin with, in the scene's coordinates: none, \"sphere X Y Z RADIUS\" or \"box "
     "X0 Y0 Z0 X1 "
     "Y1 Z1\" (default: a box estimated from the probes, of a single probe a sphere)"},
    {0}};

static const cli_choice choices[] = {
    {"geometry", "none"},
    {0},
};

static const cli_prog prog = {"ilfview",
                              "-o VIEW.html FILE [FILE2]",
                              "Make a page to look at one light field, or at two side by side.",
                              options,
                              "The page is a single file that any browser with WebGL2 opens: the plane from "
                              "above with the light on it, and what "
                              "arrives at a point of it.\n",
                              choices};

static void check_usage(int n)
{
    if (n < 1 || n > MOST_FILES) cli_fail(CLI_USAGE, "expected one light field or two, found %d", n);
    if (!output) cli_fail(CLI_USAGE, "nothing to write: expected -o VIEW.html");
    if (size_mb < .2 || size_mb > 1000)
        cli_fail(CLI_USAGE, "--size-mb: expected 0.2 to 1000 megabytes, found %g", size_mb);
}

static void write_page(const content *c, int n)
{
    outfile *out;
    errmsg e;

    if (out_begin(&out, output, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    page_write(out_stream(out), c, n);
    if (out_commit(out, &e)) cli_fail(CLI_FAILED, "%s", e.text);
}

int main(int argc, char **argv)
{
    const int n = cli_parse(&prog, argc, argv);
    content c[MOST_FILES];
    errmsg e;

    check_usage(n);
    for (int k = 0; k < n; k++) {
        const double room = (size_mb * 1e6 - page_bytes()) / n;
        if (content_read(&c[k], argv[1 + k], room, geometry_given ? &geometry : NULL, &e))
            cli_fail(CLI_FAILED, "%s", e.text);
    }
    write_page(c, n);
    for (int k = 0; k < n; k++) content_free(&c[k]);
    return cli_end(CLI_OK);
}
