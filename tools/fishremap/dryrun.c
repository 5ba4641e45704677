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
    for (int k = 0; lens_needed && k < (s->dual ? 2 : 1); k++) {
        char said[512];
        const lens_use use = {.fov_deg = s->fov_deg, .camera = s->dual && !s->lens2 ? k + 1 : 0};
        if (lens_read_for(&l, said, k && s->lens2 ? s->lens2 : s->lens, &use, e)) return -1;
    }
    const char *const falloffs[] = {s->falloff, s->falloff2};
    for (int k = 0; k < 2; k++) {
        if (!falloffs[k]) continue;
        falloff *f = malloc(sizeof *f);
        int bad = f ? falloff_read(f, falloffs[k], l.half, s->falloff_set, s->aperture, e)
                    : err_set(e, "out of memory");
        free(f);
        if (bad) return -1;
    }
    for (size_t k = 0; k < sizeof files / sizeof *files; k++)
        if (files[k] && access(files[k], R_OK) != 0) return err_errno(e, "%s", files[k]);
    return 0;
}
