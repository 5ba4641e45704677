/*
 * refine.c - nearness between the levels of a sweep.
 *
 * Each cell's differences are linearised in its nearness r: f - g_j(r) with slope g_j' give the normal equation
 * A (r' - r) = B (A, B: sums over sources and features, Cauchy weights against what sees another thing).  All cells
 * are then solved together with what is expected of walls: nearness is linear in the direction.  Along a great circle a
 * plane's nearness is a cosine, so that the mean of two cells at distance a is cos a times the one between.
 */
#include <stdlib.h>

#include "sweep.h"

static const float BEND = .02f;
enum { ROUNDS = 4, SOLVES = 60 };

void refine_linearise(equation *q, const sweep *w, const float d[3], const float f[4], float r, float delta,
                      float scale)
{
    q->a = q->b = 0;
    for (int j = 0; j < w->m->sources; j++) {
        const source *s = &w->source[j];
        float lo[4], hi[4], wt, miss = 0, slope[4], diff[4];
        const float r0 = r - delta, r1 = r + delta;
        const float e0[3] = {d[0] + r0 * s->shift[0], d[1] + r0 * s->shift[1], d[2] + r0 * s->shift[2]};
        const float e1[3] = {d[0] + r1 * s->shift[0], d[1] + r1 * s->shift[1], d[2] + r1 * s->shift[2]};
        if (!feature_look(lo, s->v, e0) || !feature_look(hi, s->v, e1)) continue;
        for (int c = 0; c < 4; c++) {
            slope[c] = (hi[c] - lo[c]) / (2 * delta), diff[c] = f[c] - .5f * (hi[c] + lo[c]);
            miss += diff[c] * diff[c];
        }
        wt = 1 / (1 + miss / (scale * scale));
        for (int c = 0; c < 4; c++) q->a += wt * slope[c] * slope[c], q->b += wt * slope[c] * diff[c];
    }
}

/* How much two cells belong together: 1, or near 0 across a step. */
static float bond(float a, float b)
{
    const float jump = (a - b) / (.12f * (fabsf(a) + fabsf(b)) + 1e-6f), q = jump * jump;

    return 1 / (1 + q * q);
}

typedef struct grid {
    const sweep *w;
    float ct, cp, wt; /* cosines of the steps round and along; weight of pairs round, of the row */
} grid;

/* What the cells beside expect of a cell, and how strongly. */
static float expected(float *strength, const grid *g, const float *near, int x, int y)
{
    const int W = g->w->m->w, H = g->w->m->h, k = y * W + x;
    const float left = near[y * W + (x + W - 1) % W], right = near[y * W + (x + 1) % W], own = near[k];
    const float up = y > 0 ? near[k - W] : near[y * W + (x + W / 2) % W],
                down = y + 1 < H ? near[k + W] : own;
    const float wh = g->wt * bond(left, own) * bond(right, own),
                wv = y + 1 < H ? bond(up, own) * bond(down, own) : 0;

    *strength = wh + wv + 1e-6f;
    return (wh * .5f * (left + right) / g->ct + wv * .5f * (up + down) / g->cp + 1e-6f * own) / *strength;
}

/* Gauss-Seidel sweeps, every other one backwards. */
static void solve(const sweep *w, const equation *q, const float *at, float *near, float stiff)
{
    const int W = w->m->w, H = w->m->h;
    const float polar = (float)w->s->v[w->m->view].polar_max / (float)H, turn = 6.2831853f / (float)W;

    for (int n = 0; n < SOLVES; n++)
        for (int i = 0; i < W * H; i++) {
            const int k = n & 1 ? W * H - 1 - i : i, x = k % W, y = k / W;
            const float s = sinf(polar * ((float)y + .5f));
            /* steps round a small circle are shorter, and bend: a pair round tells less about a plane */
            const grid g = {w, 1 - (1 - cosf(turn)) * s * s, cosf(polar),
                            fminf(1, polar / (turn * s + 1e-6f))};
            float strength;
            const float e = expected(&strength, &g, near, x, y), c = stiff * strength;
            near[k] = fmaxf(0, (q[k].a * at[k] + q[k].b + c * e) / (q[k].a + c + 1e-12f));
        }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

static float median_slope(const equation *q, float *room, int n)
{
    for (int k = 0; k < n; k++) room[k] = q[k].a;
    qsort(room, (size_t)n, sizeof *room, compare_floats);
    return room[n / 2];
}

/* How much surfaces are trusted to be smooth: cells depart from what those beside expect by BEND of the usual nearness, features
 * by the noise. */
static float stiffness(const sweep *w, const equation *q, float *room, int n)
{
    const float slope = median_slope(q, room, n);

    for (int k = 0; k < n; k++) room[k] = w->m->near[k];
    qsort(room, (size_t)n, sizeof *room, compare_floats);
    const float bend = BEND * room[n / 2] + 1e-9f, a = w->noise / bend;
    return fmaxf(.1f * slope, a * a);
}

int refine_map(sweep *w, errmsg *e)
{
    const int n = w->m->w * w->m->h;
    equation *q = malloc((size_t)n * sizeof *q);
    float *at = malloc((size_t)n * sizeof *at), step = sweep_level(w, 1), *near = w->m->near;

    if (!q || !at) {
        free(q), free(at);
        return err_set(e, "no memory for a sweep");
    }
    for (int round = 0; round < ROUNDS; round++) {
        const float delta = round ? .25f * step : .5f * step, scale = 3 * w->noise;
        for (int k = 0; k < n; k++) {
            at[k] = near[k];
            if (w->feature[k][0] > -1e3f)
                refine_linearise(&q[k], w, w->dir[k], w->feature[k], near[k], delta, scale);
            else q[k].a = q[k].b = 0;
            /* no farther than a level at once */
            q[k].b = fmaxf(-step * q[k].a, fminf(step * q[k].a, q[k].b));
        }
        solve(w, q, at, near, stiffness(w, q, w->sum, n));
    }
    const float stiff = stiffness(w, q, w->sum, n);
    for (int k = 0; k < n; k++) w->m->error[k] = w->noise / sqrtf(q[k].a + .5f * stiff + 1e-12f);
    free(q), free(at);
    return 0;
}
