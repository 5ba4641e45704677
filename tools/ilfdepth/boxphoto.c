/*
 * boxphoto.c - a box fitted to the pictures themselves (Gauss-Newton on nine numbers: three turns, six sides).
 *
 * A ray's nearness on the box is r(turns, sides); the equation a (r' - r) = b of refine.c for each ray becomes one row
 * of the normal equations, with the box's own slopes of r.
 */
#include "boxphoto.h"

#include <stdlib.h>
#include <string.h>

#include "sweep.h"
#include "vec3.h"

enum { N = 9, ROUNDS = 8, MOST_RAYS = 12000, FOLDS = 4 };

/* Turn a box's axes by small angles about them. */
static void turn(box *b, const double w[3])
{
    double old[3][3];

    memcpy(old, b->axis, sizeof old);
    for (int c = 0; c < 3; c++) {
        b->axis[0][c] += w[2] * old[1][c] - w[1] * old[2][c];
        b->axis[1][c] += w[0] * old[2][c] - w[2] * old[0][c];
        b->axis[2][c] += w[1] * old[0][c] - w[0] * old[1][c];
    }
    for (int k = 0; k < 3; k++) { /* at right angles again */
        for (int i = 0; i < k; i++)
            v3_add(b->axis[k], b->axis[k], -v3_dot(b->axis[k], b->axis[i]), b->axis[i]);
        const double l = v3_len(b->axis[k]);
        for (int c = 0; c < 3; c++) b->axis[k][c] /= l;
    }
}

static void change(box *b, const double x[N])
{
    turn(b, x);
    for (int k = 0; k < 6; k++) b->side[k] = fmax(.3 * b->side[k], b->side[k] + x[3 + k]);
}

/* Slopes of a ray's nearness. */
static void slopes(double j[N], const box *b, const double o[3], const double d[3])
{
    for (int k = 0; k < N; k++) {
        double x[N] = {0};
        box lo = *b, hi = *b;
        const double h = k < 3 ? 1e-4 : 1e-4 * b->side[k - 3];
        x[k] = h, change(&hi, x);
        x[k] = -h, change(&lo, x);
        j[k] = (box_near(&hi, o, d) - box_near(&lo, o, d)) / (2 * h);
    }
}

/* Solve a x = b (symmetric, above 0) in place; 0 if it can't be. */
static int cholesky(double x[N], double a[N][N])
{
    for (int i = 0; i < N; i++) {
        for (int k = 0; k <= i; k++) {
            double s = a[i][k];
            for (int m = 0; m < k; m++) s -= a[i][m] * a[k][m];
            if (i == k && !(s > 0)) return 0;
            a[i][k] = i == k ? sqrt(s) : s / a[k][k];
        }
        for (int m = 0; m < i; m++) x[i] -= a[i][m] * x[m];
        x[i] /= a[i][i];
    }
    for (int i = N - 1; i >= 0; i--) {
        for (int m = i + 1; m < N; m++) x[i] -= a[m][i] * x[m];
        x[i] /= a[i][i];
    }
    return 1;
}

typedef struct normal {
    double a[N][N], b[N];
} normal;

/* The rays of one map that lie on the box, every step-th. */
static void add_map(normal *q, const box *b, sweep *w, int step)
{
    const double *o = w->s->v[w->m->view].at;
    const float delta = .25f * sweep_level(w, 1);

    for (int k = w->m->view % step; k < w->m->w * w->m->h; k += step) {
        const double d[3] = {(double)w->dir[k][0], (double)w->dir[k][1], (double)w->dir[k][2]},
                     r = box_near(b, o, d);
        double j[N];
        equation eq;
        if (w->feature[k][0] < -1e3f || fabs(log((double)w->m->free[k] / r + 1e-9)) > .15) continue;
        refine_linearise(&eq, w, w->dir[k], w->feature[k], (float)r, delta, 2 * w->noise);
        slopes(j, b, o, d);
        for (int u = 0; u < N; u++) {
            for (int v = 0; v <= u; v++) q->a[u][v] += (double)eq.a * j[u] * j[v];
            q->b[u] += (double)eq.b * j[u];
        }
    }
}

/* One step of the fit; leave: fold that is left out, or -1.  Turns are held to what they are by the least: only pictures that
 * tell change them. */
static int one_step(box *b, sweep *w, int n, int leave, int step)
{
    normal q = {0};

    for (int k = 0; k < n; k++)
        if (k % FOLDS != leave && !w[k].p->held[w[k].m->view]) add_map(&q, b, &w[k], step);
    for (int u = 0; u < N; u++) {
        for (int v = 0; v < u; v++) q.a[v][u] = q.a[u][v];
        q.a[u][u] = q.a[u][u] * 1.001 + 1e-9 + (u >= 3 && !b->seen[u - 3] ? 1e12 : 0);
    }
    if (!cholesky(q.b, q.a)) return 0;
    for (int u = 0; u < 3; u++) q.b[u] = fmax(-.05, fmin(.05, q.b[u]));
    for (int u = 3; u < N; u++) q.b[u] = fmax(-.1 * b->side[u - 3], fmin(.1 * b->side[u - 3], q.b[u]));
    change(b, q.b);
    return 1;
}

static void fit(box *b, sweep *w, int n, int leave, int rounds)
{
    const int step = 1 + (int)((long)n * w->m->w * w->m->h / MOST_RAYS);

    for (int k = 0; k < rounds; k++)
        if (!one_step(b, w, n, leave, step)) return;
}

/* What all fits have in common (pictures are bilinear between texels) shows in none: a hundredth of a cell's parallax. */
static double floor_of(double side, const sweep *w)
{
    return .01 * (6.283185307 / w->p->w) / w->s->size * side * side;
}

/* Jackknife: the spread of fits that leave out a fourth of the maps each. */
static void errors(box *b, sweep *w, int n)
{
    double at[FOLDS][6], mean[6] = {0};

    for (int f = 0; f < FOLDS; f++) {
        box t = *b;
        if (n >= FOLDS) fit(&t, w, n, f, 3);
        memcpy(at[f], t.side, sizeof at[f]);
        for (int k = 0; k < 6; k++) mean[k] += t.side[k] / FOLDS;
    }
    for (int k = 0; k < 6; k++) {
        double sum = 0;
        for (int f = 0; f < FOLDS; f++) sum += (at[f][k] - mean[k]) * (at[f][k] - mean[k]);
        b->error[k] = !b->seen[k] ? 0 : hypot(sqrt((FOLDS - 1.) / FOLDS * sum), floor_of(b->side[k], &w[0]));
    }
}

int boxphoto_fit(box *b, const depthmap *maps, int n, const views *s, const sweep_plan *p, errmsg *e)
{
    sweep *w = calloc((size_t)n, sizeof *w);
    int bad = w ? 0 : err_set(e, "no memory for a box");

    for (int k = 0; k < n && !bad; k++) {
        w[k] = (sweep){.s = s, .p = p, .m = (depthmap *)&maps[k], .noise = (float)maps[k].fit};
        bad = sweep_begin(&w[k], e);
    }
    if (!bad) {
        fit(b, w, n, -1, ROUNDS);
        errors(b, w, n);
    }
    for (int k = 0; k < n && w; k++) sweep_end(&w[k]);
    free(w);
    return bad;
}
