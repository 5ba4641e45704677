/* remapjob.c - see remapjob.h. */
#include "remapjob.h"

#include <string.h>

#include "cputime.h"
#include "filter.h"
#include "remap.h"
#include "slope.h"

void session_free(session *w)
{
    remap_plan_free(w->plan);
    w->plan = NULL;
}

/* What remap_areas needs to know. */
typedef struct remap_job {
    outcome *o;
    session *w;
    const chart *src;
    const remap_source *ready;
} remap_job;

/* By the session's weights where they fit. */
static int remap_areas(float *rgb, float *alpha, const chart *dst, void *arg, errmsg *e)
{
    const remap_job *j = arg;
    session *w = j->w;
    int rc = 0, shared = w && w->several && !j->ready->bad && j->src->width < 65536 && j->src->height < 65536;
    double t0 = cpu_seconds();
    if (shared && !(w->plan && memcmp(&w->src, j->src, sizeof *j->src) == 0 &&
                    memcmp(&w->dst, dst, sizeof *dst) == 0)) {
        session_free(w);
        rc = remap_plan_new(&w->plan, dst, j->src, e);
        w->src = *j->src, w->dst = *dst;
        j->o->cpu_plan_s += cpu_seconds() - t0;
    }
    if (!rc && shared) rc = remap_apply(rgb, alpha, w->plan, j->ready, e);
    else if (!rc) rc = remap_run(rgb, alpha, dst, j->src, j->ready, e);
    return rc;
}

int remap_picture(float *rgb, float *alpha, outcome *o, session *w, const settings *s, img *im, int all_good,
                  const chart *src, const chart *dst, errmsg *e)
{
    remap_source ready;
    double t0 = cpu_seconds(), plan = o->cpu_plan_s;
    if (source_clean(&ready, im->pix, im->info.width, im->info.height, all_good, src, e)) return -1;
    double t1 = cpu_seconds();
    o->cpu_prepare_s += t1 - t0;
    o->bad_pixels += ready.nbad;
    remap_job j = {o, w, src, &ready};
    int rc = filter_texels(rgb, alpha, dst, s->filter_sd, remap_areas, &j, e);
    o->cpu_remap_s += cpu_seconds() - t1 - (o->cpu_plan_s - plan);
    source_free(&ready);
    return rc;
}
