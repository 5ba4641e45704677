/*
 * judge.c - which surface predicts best what pictures show that had no part in it.
 */
#include "judge.h"

#include <stdlib.h>
#include <string.h>

#include "feature.h"
#include "vec3.h"

enum { RAYS = 1500, NEIGHBOURS = 4 };
const char *const judge_names[SURFACES] = {"box", "mixed", "free", "far"};

double surface_near(const surface *f, const double o[3], const double d[3])
{
    if (f->kind == SURFACE_FAR) return 0;
    return f->kind == SURFACE_BOX ? box_near(f->box, o, d) : shell_near(f->shell, o, d);
}

typedef struct neighbour {
    int view;
    double weight;
} neighbour;

/* The four nearest pictures that are not held, by the inverse square of their distance. */
static int neighbours(neighbour b[NEIGHBOURS], int own, const views *s, const int *held)
{
    int n = 0;

    for (int k = 0; k < s->n; k++) {
        double e[3];
        if (held[k]) continue;
        v3_add(e, s->v[k].at, -1, s->v[own].at);
        neighbour one = {k, 1 / (v3_dot(e, e) + 1e-9 * s->size * s->size)};
        for (int i = 0; i < n; i++)
            if (one.weight > b[i].weight) {
                const neighbour t = b[i];
                b[i] = one, one = t;
            }
        if (n < NEIGHBOURS) b[n++] = one;
    }
    return n;
}

/* Difference of what is predicted and seen, in the logarithms of colours; below 0: can't be told. */
static double one_ray(int own, const double d[3], double r, const neighbour *b, int n, const views *s)
{
    const float e0[3] = {(float)d[0], (float)d[1], (float)d[2]};
    float seen[4], sum[3] = {0}, all = 0;

    if (!feature_look(seen, &s->v[own], e0)) return -1;
    for (int k = 0; k < n; k++) {
        float g[4], e[3];
        for (int c = 0; c < 3; c++) e[c] = (float)(d[c] + r * (s->v[own].at[c] - s->v[b[k].view].at[c]));
        if (!feature_look(g, &s->v[b[k].view], e)) continue;
        for (int c = 0; c < 3; c++) sum[c] += (float)b[k].weight * g[c];
        all += (float)b[k].weight;
    }
    if (!(all > 0)) return -1;
    const float miss =
        (fabsf(seen[0] - sum[0] / all) + fabsf(seen[1] - sum[1] / all) + fabsf(seen[2] - sum[2] / all)) / 3;
    return fmin(.5, (double)miss);
}

/* Does a ray meet a shell where a thing is marked? */
static int on_thing(const shell *h, const double o[3], const double d[3])
{
    const double near = shell_near(h, o, d);
    double x[3];

    v3_add(x, o, 1 / fmax(near, 1e-9), d);
    v3_add(x, x, -1, h->c);
    return near > 0 && h->thing[shell_node(h, x)];
}

/* All rays of the held pictures; a ray's misses by all surfaces lie side by side, below 0 where it can't be told:
 * at things, and where a surface is nearer than was looked for. */
static int all_rays(double *miss, const surface *f, int n, const shell *things, const views *s,
                    const sweep_plan *p)
{
    const double golden = 2.399963229728653;
    int rays = 0;

    for (int v = 0; v < s->n; v++) {
        neighbour b[NEIGHBOURS];
        if (!p->held[v]) continue;
        const int many = neighbours(b, v, s, p->held);
        const double low = s->below ? -.98 : .02;
#pragma omp parallel for schedule(static)
        for (int k = 0; k < RAYS; k++) {
            const double z = low + (.98 - low) * (k + .5) / RAYS, q = sqrt(1 - z * z);
            const double d[3] = {q * cos(golden * k), q * sin(golden * k), z};
            double r[SURFACES];
            int skip = things && on_thing(things, s->v[v].at, d);
            for (int i = 0; i < n; i++)
                r[i] = surface_near(&f[i], s->v[v].at, d), skip |= r[i] > .95 * p->most;
            for (int i = 0; i < n; i++)
                miss[((size_t)rays + (size_t)k) * SURFACES + (size_t)i] =
                    skip ? -1 : one_ray(v, d, r[i], b, many, s);
        }
        rays += RAYS;
    }
    return rays;
}

/* Mean of a - b over rays, and its standard error (neighbouring rays fail together: eight count as one). */
static double compare(double *se, const double *miss, int rays, int a, int b)
{
    double sum = 0, squares = 0;
    int n = 0;

    for (int k = 0; k < rays; k++) {
        const double x = miss[k * SURFACES + a], y = miss[k * SURFACES + b];
        if (x < 0 || y < 0) continue;
        sum += x - y, squares += (x - y) * (x - y), n++;
    }
    const double mean = n ? sum / n : 0;
    *se = n ? sqrt(fmax(0, squares / n - mean * mean) / n * 8) : 0;
    return mean;
}

int judge_surfaces(verdict *v, const surface *f, int n, const shell *things, const views *s,
                   const sweep_plan *p, errmsg *e)
{
    int held = 0, best = 0;

    memset(v, 0, sizeof *v);
    for (int k = 0; k < SURFACES; k++) v->error[k] = -1;
    for (int k = 0; k < s->n; k++) held += p->held[k];
    v->best = f[0].kind;
    if (!held) return 0;
    double *miss = malloc((size_t)held * RAYS * SURFACES * sizeof *miss), se;
    if (!miss) return err_set(e, "no memory to judge surfaces");
    v->rays = all_rays(miss, f, n, things, s, p);
    for (int i = 0; i < n; i++) {
        double sum = 0;
        int many = 0;
        for (int k = 0; k < v->rays; k++)
            if (miss[k * SURFACES + i] >= 0) sum += miss[k * SURFACES + i], many++;
        v->error[f[i].kind] = many ? sum / many : 0;
        const double gain = -compare(&se, miss, v->rays, i, best);
        v->better[f[i].kind] = se > 0 ? gain / se : 0;
        if (i && gain > 2 * se && gain > .03 * v->error[f[best].kind] && f[i].kind != SURFACE_FAR) best = i;
    }
    v->best = f[best].kind;
    free(miss);
    return 0;
}
