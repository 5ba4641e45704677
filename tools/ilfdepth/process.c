/*
 * process.c - from pictures to maps of distances and a surface.
 */
#include "process.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "agree.h"
#include "base/cli.h"
#include "feature.h"
#include "vec3.h"

static const double pi = 3.14159265358979323846;

/* One picture in eight judges, spread over all, where there are enough. */
static void hold(process *q)
{
    const int n = q->s.n, many = n < 9 ? 0 : n / 8 < 12 ? n / 8 + (n < 16) : 12;

    for (int k = 0; k < many; k++) q->held[(int)(fmod((k + 1) * .61803398875, 1) * n)] = 1;
}

static int sweeps(process *q, errmsg *e)
{
    int bad = 0, done = 0;

#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < q->s.n; k++) {
        errmsg mine;
        const int failed =
            depthmap_make(&q->maps[k], k, &q->p, &mine) || depthmap_sweep(&q->maps[k], &q->s, &q->p, &mine);
#pragma omp critical
        {
            if (failed && !bad) {
                bad = -1;
                if (e) *e = mine;
            }
            cli_progress("sweeping", ++done, q->s.n);
        }
    }
    return bad;
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* What stands before the box, as the maps have it. */
static void find_things(process *q)
{
    double all = 1e-30, *far = malloc((size_t)q->s.n * (size_t)q->p.w * (size_t)q->p.h * sizeof *far);
    int n = 0;

    for (int k = 0; k < q->s.n && far; k++)
        for (int i = 0; i < q->p.w * q->p.h; i++) {
            const depthmap *m = &q->maps[k];
            double d[3];
            depthmap_direction(d, m, &q->s, i % m->w, i / m->w);
            const double sr = sin(q->s.v[k].polar_max * (i / m->w + .5) / m->h);
            all += sr;
            if (m->from[i] == DEPTH_BOX || m->sure[i] < .5f ||
                (double)m->near[i] < 1.1 * box_near(&q->b, q->s.v[k].at, d))
                continue;
            q->things += sr, far[n++] = 1 / (double)m->near[i];
        }
    q->things /= all;
    if (n) qsort(far, (size_t)n, sizeof *far, compare);
    q->thing = n ? far[n / 20] : 0;
    free(far);
}

static int surfaces(process *q, const process_plan *plan, errmsg *e)
{
    surface f[SURFACES];
    int n = 0;

    if (shell_fuse(&q->free, q->maps, q->s.n, 1, &q->s, &q->p, e)) return -1;
    if (q->b.fitted) {
        if (shell_fuse(&q->mixed, q->maps, q->s.n, 0, &q->s, &q->p, e)) return -1;
        if (!plan->things) {
            if (shell_mark_things(&q->mixed, &q->b, e)) return -1;
            shell_drop_things(&q->free, &q->mixed, &q->b);
        }
        f[n++] = (surface){SURFACE_BOX, &q->b, NULL}, f[n++] = (surface){SURFACE_MIXED, NULL, &q->mixed};
    }
    f[n++] = (surface){SURFACE_FREE, NULL, &q->free}, f[n++] = (surface){SURFACE_FAR, NULL, NULL};
    if (judge_surfaces(&q->v, f, n, q->b.fitted && !plan->things ? &q->mixed : NULL, &q->s, &q->p, e))
        return -1;
    if (q->b.fitted && !plan->things) shell_drop_things(&q->mixed, &q->mixed, &q->b);
    if (!q->v.rays && q->b.fitted && q->b.explains < .7) q->v.best = SURFACE_MIXED;
    if (plan->asked >= 0) q->v.best = (surface_kind)plan->asked;
    for (int k = 0; k < n; k++)
        if (f[k].kind == q->v.best) return mesh_make(&q->m, &f[k], q->maps, q->s.n, &q->s, e);
    return err_set(e, "expected a room that is about a box for --surface %s, found none",
                   judge_names[q->v.best]);
}

int process_run(process *q, const process_plan *plan, errmsg *e)
{
    const clock_t from = clock();

    sweep_plan_make(&q->p, &q->s, plan->near, plan->width);
    q->held = calloc((size_t)q->s.n, sizeof *q->held), q->maps = calloc((size_t)q->s.n, sizeof *q->maps);
    if (!q->held || !q->maps) return err_set(e, "no memory");
    q->p.held = q->held;
    hold(q);
    if (feature_make(&q->s, pi / q->p.w, e) || sweeps(q, e) ||
        box_fit(&q->b, q->maps, q->s.n, &q->s, &q->p, e))
        return -1;
    if (q->b.fitted && box_compete(q->maps, q->s.n, &q->b, &q->s, &q->p, e)) return -1;
    agree_maps(q->maps, q->s.n, &q->s);
    if (q->b.fitted) find_things(q);
    const int bad = surfaces(q, plan, e) || views_unchanged(&q->s, e);
    q->cpu_s = (double)(clock() - from) / CLOCKS_PER_SEC;
    return bad ? -1 : 0;
}

void process_free(process *q)
{
    for (int k = 0; q->maps && k < q->s.n; k++) depthmap_free(&q->maps[k]);
    free(q->maps), free(q->held);
    shell_free(&q->mixed), shell_free(&q->free), mesh_free(&q->m);
    views_free(&q->s);
}
