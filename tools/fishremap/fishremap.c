/*
 * fishremap - camera pictures to calibrated light probes.
 *
 * This file owns the messages; options.c and usage.c the command line; picture.c and spherearray.c do the two
 * jobs.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "dryrun.h"
#include "image/image.h"
#include "options.h"
#include "picture.h"
#include "report.h"
#include "spherearray.h"

/* OUT with its % replaced by the picture's name without folder and ending; malloc'd. */
static char *name_for(const char *out, const char *in)
{
    const char *base = strrchr(in, '/'), *mark = strchr(out, '%');
    base = base ? base + 1 : in;
    const char *dot = strrchr(base, '.');
    int len = dot && dot > base ? (int)(dot - base) : (int)strlen(base);
    char *name;
    if (asprintf(&name, "%.*s%.*s%s", (int)(mark - out), out, len, base, mark + 1) < 0)
        cli_fail(CLI_FAILED, "out of memory");
    return name;
}

static void tell(const outcome *o, const char *in, int several)
{
    const char *of = several ? in : "", *sep = several ? ": " : "";
    if (o->bad_pixels)
        cli_note("%s%s%lld pixels were not finite or masked and were left out", of, sep,
                 (long long)o->bad_pixels);
    if (o->remark[0]) cli_note("%s%s%s", of, sep, o->remark);
}

int main(int argc, char **argv)
{
    errmsg e;
    outcome o = {0};
    session shared[2] = {{0}, {0}};
    int n = cli_parse(&prog, argc, argv);
    usage_check(&cfg, n);
    if (cfg.out_w > IMG_MAX_SIDE || cfg.out_h > IMG_MAX_SIDE ||
        (int64_t)cfg.out_w * cfg.out_h > IMG_MAX_PIXELS / 4)
        cli_fail(CLI_FAILED, "--size: expected sides up to %d and up to %lld pixels, found %dx%d",
                 IMG_MAX_SIDE, (long long)IMG_MAX_PIXELS / 4, cfg.out_w, cfg.out_h);
    if (cfg.dry_run) {
        if (job_dry_run(&cfg, &e)) cli_fail(CLI_FAILED, "%s", e.text);
        return cli_end(CLI_OK);
    }
    cfg.progress = cli_progress;
    cfg.command = cli_command_line(&prog, argc, argv);
    shared[0].several = shared[1].several = n > 1;
    const char *out = cfg.out;
    for (int k = 1; k <= n; k++) {
        char *name = n > 1 ? name_for(out, argv[k]) : NULL;
        cfg.in = argv[k];
        if (name) cfg.out = name;
        o.bad_pixels = 0, o.remark[0] = 0;
        if (cfg.nu ? job_array(&o, &cfg, &e) : job_picture(&o, shared, &cfg, &e))
            cli_fail(CLI_FAILED, "%s", e.text);
        tell(&o, cfg.in, n > 1);
        if (n > 1) cli_progress("pictures", k, n);
        free(name);
    }
    for (int k = 0; k < 2; k++) session_free(shared + k);
    if (cfg.report && report_write(cfg.report, &o, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    free(o.spheres);
    return cli_end(CLI_OK);
}
