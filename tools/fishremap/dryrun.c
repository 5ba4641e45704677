/*
 * dryrun.c - see dryrun.h.
 */
#include "dryrun.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "falloff.h"
#include "lens.h"
#include "lensfile.h"

int job_dry_run(const settings *s, errmsg *e)
{
    lens l = {.half = M_PI / 2};
    const char *const files[] = {s->mask, s->second, s->second_mask};
    int lens_needed = !s->nu && (s->from == VIEW_FISHEYE || s->to == VIEW_FISHEYE);
    if (lens_needed && lens_read(&l, s->lens, s->fov_deg, e)) return -1;
    if (s->falloff) {
        falloff *f = malloc(sizeof *f);
        int bad = f ? falloff_read(f, s->falloff, l.half, s->falloff_set, s->aperture, e)
                    : err_set(e, "out of memory");
        free(f);
        if (bad) return -1;
    }
    for (size_t k = 0; k < sizeof files / sizeof *files; k++)
        if (files[k] && access(files[k], R_OK) != 0) return err_errno(e, "%s", files[k]);
    return 0;
}
