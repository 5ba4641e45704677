/*
 * sweep.c - spheres round a picture's place, on which the others should see what it sees.
 */
#include "sweep.h"

#include <stdlib.h>
#include <string.h>

#include "vec3.h"

static const float BOUND = .3f; /* a source that sees another thing counts no more than this */

float sweep_level(const sweep *w, double level)
{
    return (float)(w->p->most * level / (w->p->levels - 1));
}

typedef struct choice {
    double far;
    int number;
} choice;

static int nearer(const void *a, const void *b)
{
    const choice *x = a, *y = b;

    return x->far < y->far ? -1 : x->far > y->far ? 1 : x->number - y->number;
}

/* Sources: from all distances, evenly; those nearest see round corners, those farthest tell distances best.  In the end
 * they lie in the order of the sides on which they stand. */
static int choose(sweep *w, errmsg *e)
{
    const views *s = w->s;
    const view *own = &s->v[w->m->view];
    choice *c = malloc((size_t)s->n * sizeof *c);
    int n = 0;

    if (!c) return err_set(e, "no memory");
    for (int k = 0; k < s->n; k++) {
        double b[3];
        v3_add(b, s->v[k].at, -1, own->at);
        if (v3_len(b) > 1e-6 * s->size && !w->p->held[k]) c[n++] = (choice){v3_len(b), k};
    }
    qsort(c, (size_t)n, sizeof *c, nearer);
    const int most = 12 < n ? 12 : n;
    for (int k = 0; k < most; k++) {
        double b[3];
        c[k] = c[(int)((k + .5) * n / most)];
        v3_add(b, s->v[c[k].number].at, -1, own->at);
        c[k].far = atan2(b[1], b[0]);
    }
    qsort(c, (size_t)most, sizeof *c, nearer);
    for (int k = 0; k < most; k++) w->m->source[k] = c[k].number;
    w->m->sources = most;
    free(c);
    return n ? 0 : err_set(e, "%s: expected other pictures from other places, found none", own->name);
}

static void place_sources(sweep *w)
{
    for (int k = 0; k < w->m->sources; k++) {
        w->source[k].v = &w->s->v[w->m->source[k]];
        for (int c = 0; c < 3; c++)
            w->source[k].shift[c] = (float)(w->s->v[w->m->view].at[c] - w->source[k].v->at[c]);
    }
}

static void own_features(sweep *w)
{
    for (int k = 0; k < w->m->w * w->m->h; k++) {
        double d[3];
        depthmap_direction(d, w->m, w->s, k % w->m->w, k / w->m->w);
        for (int c = 0; c < 3; c++) w->dir[k][c] = (float)d[c];
        if (!feature_look(w->feature[k], &w->s->v[w->m->view], w->dir[k])) w->feature[k][0] = FEATURE_NOTHING;
    }
}

static float one_source(const source *s, const float d[3], const float f[4], float r, int *n)
{
    const float e[3] = {d[0] + r * s->shift[0], d[1] + r * s->shift[1], d[2] + r * s->shift[2]};
    float g[4];

    if (!feature_look(g, s->v, e)) return 0;
    ++*n;
    return fminf(BOUND, feature_differ(f, g));
}

/* Behind an edge half of the sources see something else: of four groups, each from one side, the better two count. */
float sweep_cost(const sweep *w, const float d[3], const float f[4], float r)
{
    const int all = w->m->sources, groups = all >= 8 ? 4 : 1;
    float best = 1e30f, second = 1e30f;

    for (int g = 0; g < groups; g++) {
        float sum = 0;
        int n = 0;
        for (int k = g * all / groups; k < (g + 1) * all / groups; k++)
            sum += one_source(&w->source[k], d, f, r, &n);
        const float mean = n ? sum / (float)n : BOUND;
        if (mean < best) second = best, best = mean;
        else if (mean < second) second = mean;
    }
    return groups > 1 ? .5f * (best + second) : best;
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* All hypotheses of all cells, and the median over cells of the least cost. */
static void all_costs(sweep *w)
{
    const int cells = w->m->w * w->m->h, levels = w->p->levels;
    float *least = w->sum;

    for (int k = 0; k < cells; k++) {
        float *c = w->cost + (size_t)k * (size_t)levels;
        float best = BOUND;
        for (int l = 0; l < levels; l++) {
            c[l] = w->feature[k][0] > -1e3f ? sweep_cost(w, w->dir[k], w->feature[k], sweep_level(w, l)) : 0;
            best = fminf(best, c[l]);
        }
        least[k] = best;
    }
    qsort(least, (size_t)cells, sizeof *least, compare_floats);
    w->noise = fmaxf(1e-4f, least[cells / 2]);
}

/* The mean along a row (or column) of the costs of `reach` cells to both sides. */
static void mean_along(float *to, const sweep *w, int x, int y, int reach, int down)
{
    const int W = w->m->w, L = w->p->levels;
    int n = 0;

    memset(to, 0, (size_t)L * sizeof *to);
    for (int k = -reach; k <= reach; k++) {
        const int u = down ? x : (x + k + W) % W, v = down ? y + k : y;
        if (v < 0 || v >= w->m->h) continue;
        const float *c = w->cost + ((size_t)v * (size_t)W + (size_t)u) * (size_t)L;
        for (int l = 0; l < L; l++) to[l] += c[l];
        n++;
    }
    for (int l = 0; l < L; l++) to[l] /= (float)n;
}

/* Few sources say little of a single cell: cells round it are heard, too. */
static void gather(sweep *w)
{
    const int reach = w->m->sources <= 2 ? 3 : w->m->sources <= 5;

    for (int down = 0; down < 2 && reach; down++) {
        for (int k = 0; k < w->m->w * w->m->h; k++)
            mean_along(w->sum + (size_t)k * (size_t)w->p->levels, w, k % w->m->w, k / w->m->w, reach, down);
        float *t = w->cost;
        w->cost = w->sum, w->sum = t;
    }
}

/* How likely the best level is, of all: the share within a tenth of it (or a level and a half). */
static float likely(const sweep *w, const float *sum, int best)
{
    const float at = sweep_level(w, best), wide = fmaxf(.1f * at, 1.5f * sweep_level(w, 1));
    double all = 0, near = 0;

    for (int l = 0; l < w->p->levels; l++) {
        const double p = exp(-(double)(sum[l] - sum[best]) / (8 * 1.5 * (double)w->noise));
        all += p;
        if (fabsf(sweep_level(w, l) - at) <= wide) near += p;
    }
    return (float)(near / all);
}

static void take_best(sweep *w)
{
    for (int k = 0; k < w->m->w * w->m->h; k++) {
        const float *sum = w->sum + (size_t)k * (size_t)w->p->levels;
        int best = 0;
        for (int l = 1; l < w->p->levels; l++)
            if (sum[l] < sum[best]) best = l;
        w->m->near[k] = sweep_level(w, best);
        w->m->sure[k] = w->feature[k][0] > -1e3f ? likely(w, sum, best) : 0;
    }
}

int sweep_begin(sweep *w, errmsg *e)
{
    const size_t cells = (size_t)w->m->w * (size_t)w->m->h;

    w->dir = malloc(cells * sizeof *w->dir), w->feature = malloc(cells * sizeof *w->feature);
    if (!w->dir || !w->feature) {
        sweep_end(w);
        return err_set(e, "no memory for a sweep");
    }
    place_sources(w), own_features(w);
    return 0;
}

void sweep_end(sweep *w)
{
    free(w->dir), free(w->feature), free(w->cost), free(w->sum);
    w->dir = NULL, w->feature = NULL, w->cost = w->sum = NULL;
}

int depthmap_sweep(depthmap *m, const views *s, const sweep_plan *p, errmsg *e)
{
    const size_t cells = (size_t)m->w * (size_t)m->h;
    sweep w = {.s = s, .p = p, .m = m};

    if (choose(&w, e) || sweep_begin(&w, e)) return -1;
    w.cost = malloc(cells * (size_t)p->levels * sizeof *w.cost);
    w.sum = calloc(cells * (size_t)p->levels, sizeof *w.sum);
    int bad = w.cost && w.sum ? 0 : err_set(e, "no memory for a sweep");
    if (!bad) {
        all_costs(&w), gather(&w);
        bad = paths_sum(&w, e);
    }
    if (!bad) {
        take_best(&w);
        bad = refine_map(&w, e);
    }
    if (!bad) memcpy(m->free, m->near, cells * sizeof *m->free), m->fit = (double)w.noise;
    sweep_end(&w);
    return bad;
}
