/*
 * ilftrace.c - look rays up in an incident light field, no renderer involved.
 *
 * Standard input: one ray a line, "ox oy oz dx dy dz hx hy hz": origin, direction towards the
 * light, point where it meets the auxiliary geometry ("inf inf inf": infinitely far away).
 * Standard output: "R G B" for each.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "field_guard.h"
#include "ilf.h"

static int no_depth, report;
static double memory;
static const char *plane;

static const cli_opt options[] = {
    {"nodepth", 0, CLI_FLAG, &no_depth, NULL, NULL,
     "look all probes up in the ray's direction (no depth correction)"},
    {"plane", 0, CLI_STRING, &plane, NULL, "\"O U V [N]\"",
     "plane to use instead of the file's: 9 or 12 numbers, as the material's"},
    {"memory", 0, CLI_DOUBLE, &memory, NULL, "MB",
     "of a compressed file's probes keep so many decoded ones (default: all\nthat were needed)"},
    {"report", 0, CLI_FLAG, &report, NULL, NULL, "say on stderr at the end how many probes were used"},
    {0}};

static const cli_prog prog = {
    "ilftrace",
    "FILE < RAYS",
    "Look up rays in an incident light field.",
    options,
    "Each line of standard input is a ray: ox oy oz dx dy dz hx hy hz (origin, direction,\n"
    "hit point on the auxiliary geometry; inf inf inf when that is infinitely far away).\n"
    "Each line of output is its radiance: R G B.\n",
    NULL};

/* Nine numbers and nothing else; 0 on success, else the number of numbers found, or -1 for more. */
static int read_ray(double ray[9], const char *line)
{
    char *end;

    for (int k = 0; k < 9; k++) {
        ray[k] = strtod(line, &end);
        if (end == line) return k ? k : 10;
        line = end;
    }
    return line[strspn(line, " \t\r\n")] ? -1 : 0;
}

static void set_frame(ilf_frame *frame, const ilf *field)
{
    ilf_error err;
    errmsg words;
    double v[12];
    int n = 0;

    *frame = *ilf_get_frame(field);
    if (!plane) return;
    if (cli_parse_doubles(v, 12, plane, " ", &words) == 0) n = 12;
    else if (cli_parse_doubles(v, 9, plane, " ", &words) == 0) n = 9;
    else cli_fail(CLI_USAGE, "--plane: expected 9 or 12 numbers, found \"%s\"", plane);
    if (ilf_frame_init(frame, v, v + 3, v + 6, n == 12 ? v + 9 : NULL, &err) != ILF_OK)
        cli_fail(CLI_USAGE, "--plane: %s", err.text);
    if (ilf_check_frame(field, frame, &err) != ILF_OK) cli_fail(CLI_USAGE, "--plane: %s", err.text);
}

int main(int argc, char **argv)
{
    const int n = cli_parse(&prog, argc, argv);
    char *line = NULL;
    size_t room = 0;
    long number = 0;
    ilf_frame frame;
    ilf_error err;
    ilf *field;

    if (n != 1) cli_fail(CLI_USAGE, "expected one light field, found %d", n);
    if (field_open(&field, argv[1], &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    if (memory < 0 || memory > 1e12)
        cli_fail(CLI_USAGE, "--memory: expected megabytes, 0 or more, found %g", memory);
    if (ilf_set_memory(field, (int64_t)(memory * 1e6), &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    set_frame(&frame, field);

    while (errno = 0, getline(&line, &room, stdin) > 0) {
        double ray[9];
        float rgb[3];

        number++;
        if (!line[strspn(line, " \t\r\n")]) continue; /* blank */
        const int bad = read_ray(ray, line);
        if (bad) {
            fflush(stdout);
            cli_fail(CLI_FAILED, "standard input, line %ld: expected 9 numbers, found %s", number,
                     bad < 0     ? "more"
                     : bad == 10 ? "none"
                                 : "fewer");
        }
        for (int k = 0; k < 6; k++)
            if (!isfinite(ray[k]))
                cli_fail(CLI_FAILED, "standard input, line %ld: expected finite numbers, found %g", number,
                         ray[k]);
        const int at_infinity = isinf(ray[6]) && isinf(ray[7]) && isinf(ray[8]);
        if (ilf_check_unchanged(field, &err) != ILF_OK ||
            ilf_eval(rgb, field, &frame, ray, ray + 3, at_infinity ? NULL : ray + 6,
                     no_depth ? ILF_NO_DEPTH : ILF_DEPTH, &err) != ILF_OK) {
            fflush(stdout);
            if (err.status == ILF_ERR_ARG)
                cli_fail(CLI_FAILED, "standard input, line %ld: %s", number, err.text);
            cli_fail(CLI_FAILED, "%s", err.text);
        }
        if (printf("%.9g %.9g %.9g\n", (double)rgb[0], (double)rgb[1], (double)rgb[2]) < 0) break;
    }
    if (ferror(stdin)) cli_fail(CLI_FAILED, "standard input: %s", strerror(errno));
    free(line);
    if (ilf_check_unchanged(field, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    if (report) {
        ilf_usage use;
        ilf_get_usage(&use, field);
        cli_warn("%s: %lld of %lld probes used, %.1f MB in place, %.1f MB decoded", argv[1],
                 (long long)use.probes, (long long)ilf_get_info(field)->n_u * ilf_get_info(field)->n_v,
                 (double)use.mapped_bytes * 1e-6, (double)use.decoded_bytes * 1e-6);
    }
    field_close(field);
    return cli_end(CLI_OK);
}
