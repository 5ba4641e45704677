/*
 * agree.c - what the maps say of each other.
 */
#include "agree.h"

#include <stdlib.h>
#include <string.h>

#include "vec3.h"

typedef struct votes {
    int same, through, hidden;
} votes;

/* Does map m have something at p? */
static void vote(votes *v, const depthmap *m, const views *s, const double p[3])
{
    double e[3];

    v3_add(e, p, -1, s->v[m->view].at);
    const int k = depthmap_cell(m, s, e);
    if (k < 0) return;
    const double far = v3_len(e), q = (double)m->near[k] * far;
    if (fabs(q - 1) < .1) v->same++;
    else if (q < 1) v->through++;
    else v->hidden++;
}

static float judged(const votes *v, const depthmap *m, int k)
{
    const float share =
        ((float)v->same + 1) / ((float)(v->same + v->through) + .7f * (float)v->hidden + 1.3f);

    return fminf(1, m->from[k] == DEPTH_BOX ? share : share * sqrtf(m->sure[k]));
}

static void one_map(float *sure, const depthmap *m, const depthmap *maps, int n, const views *s)
{
    for (int k = 0; k < m->w * m->h; k++) {
        votes v = {0};
        double d[3], p[3];
        depthmap_direction(d, m, s, k % m->w, k / m->w);
        sure[k] = m->sure[k];
        if (!(m->near[k] > 0)) continue;
        v3_add(p, s->v[m->view].at, 1 / (double)m->near[k], d);
        for (int i = 0; i < n; i++)
            for (int j = 0; j < m->sources; j++)
                if (maps[i].view == m->source[j]) vote(&v, &maps[i], s, p);
        sure[k] = judged(&v, m, k);
    }
}

void agree_maps(depthmap *maps, int n, const views *s)
{
    const size_t cells = n ? (size_t)maps[0].w * (size_t)maps[0].h : 0;
    float *sure = malloc((size_t)n * cells * sizeof *sure);

    if (!sure) return; /* they stay as sure as they think themselves */
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < n; k++) one_map(sure + (size_t)k * cells, &maps[k], maps, n, s);
    for (int k = 0; k < n; k++) memcpy(maps[k].sure, sure + (size_t)k * cells, cells * sizeof *sure);
    free(sure);
}
