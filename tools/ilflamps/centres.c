/*
 * centres.c - where lamps hang: for each spot that has no lamp, the brightest first, meet its ray with those
 * of other probes; the meeting point that most probes have a spot at is a lamp; then least squares over the
 * rays, weighted by how much of the lamp each probe sees (a lamp that is half hidden has its middle
 * elsewhere).
 */
#include "centres.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { LEAST_PROBES = 4, TRIES = 48 };

/* Where two rays come closest, midway; 0 if they run apart. */
static int meet(double x[3], const double p[3], const double a[3], const double q[3], const double b[3],
                double furthest)
{
    double e[3];
    const double ab = v_dot(a, b), s = 1 - ab * ab;

    v_sub(e, q, p);
    const double ea = v_dot(e, a), eb = v_dot(e, b);
    double t = furthest, u = furthest;
    if (s > 1e-12) t = (ea - ab * eb) / s, u = (ab * ea - eb) / s;
    if (!(t > 0) || !(u > 0) || t > furthest) t = u = furthest;
    for (int k = 0; k < 3; k++) x[k] = .5 * (p[k] + t * a[k] + q[k] + u * b[k]);
    return 1;
}

/* Angle that a spot's middle may be off: part of a texel, and of the spot (which may be half hidden). */
static double tolerance(const lightfield *f, const blob *b)
{
    const double st = sqrt(fmax(0, 1 - b->dir[2] * b->dir[2]));

    return .7 * fmax(f->dp, f->dt * st) + .6 * b->reach;
}

/* The spots of each probe that point at x: the nearest one in `mine` (-1: none).  Returns the number of
 * probes. */
static int support(int *mine, const double x[3], const bloblist *l, const lightfield *f)
{
    int n = 0;
    double best = 0;

    for (int k = 0; k < f->n; k++) mine[k] = -1;
    for (int i = 0; i < l->n; i++) {
        const blob *b = &l->b[i];
        double e[3];
        if (b->lamp != -1) continue;
        v_sub(e, x, f->pos[b->probe]);
        v_unit(e);
        const double off = sqrt(fmax(0, 2 - 2 * v_dot(e, b->dir)));
        if (off > tolerance(f, b)) continue;
        if (mine[b->probe] < 0) n++, best = off;
        else if (off >= best) continue;
        best = off, mine[b->probe] = i;
    }
    return n;
}

static int solve3(double x[3], double m[3][3], const double y[3])
{
    double a[3][4];

    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++) a[r][c] = c < 3 ? m[r][c] : y[r];
    for (int k = 0; k < 3; k++) {
        int p = k;
        for (int r = k + 1; r < 3; r++)
            if (fabs(a[r][k]) > fabs(a[p][k])) p = r;
        if (fabs(a[p][k]) < 1e-300) return 0;
        for (int c = 0; c < 4; c++) {
            const double t = a[k][c];
            a[k][c] = a[p][c], a[p][c] = t;
        }
        for (int r = 0; r < 3; r++)
            for (int c = 3; r != k && c >= k; c--) a[r][c] -= a[r][k] / a[k][k] * a[k][c];
    }
    for (int k = 0; k < 3; k++) x[k] = a[k][3] / a[k][k];
    return 1;
}

/* Weighted mean square angle between rays and spots. */
static double misfit(const double x[3], const int *mine, const double *w, const bloblist *l,
                     const lightfield *f)
{
    double sum = 0, weight = 0;

    for (int k = 0; k < f->n; k++) {
        double e[3];
        if (mine[k] < 0) continue;
        v_sub(e, x, f->pos[k]);
        v_unit(e);
        sum += w[k] * (2 - 2 * v_dot(e, l->b[mine[k]].dir)), weight += w[k];
    }
    return sum / weight;
}

/* Least squares over the rays; w: share of the lamp that each sees, squared. */
static void refine(double x[3], double *sigma, const int *mine, double *w, const bloblist *l,
                   const lightfield *f)
{
    for (int round = 0; round < 8; round++) {
        double m[3][3] = {{0}}, y[3] = {0}, top = 0, best[3];
        int n = 0;
        for (int k = 0; k < f->n; k++) {
            double e[3];
            if (mine[k] < 0) continue;
            v_sub(e, x, f->pos[k]);
            w[k] = l->b[mine[k]].flux * v_dot(e, e);
            top = fmax(top, w[k]);
        }
        for (int k = 0; k < f->n; k++) {
            double e[3];
            if (mine[k] < 0) continue;
            const double *d = l->b[mine[k]].dir;
            v_sub(e, x, f->pos[k]);
            const double share = w[k] / top, s = share * share * (share > .9 ? 4 : 1);
            w[k] = s, n++;
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++) {
                    const double g = s / v_dot(e, e) * ((r == c) - d[r] * d[c]);
                    m[r][c] += g, y[r] += g * f->pos[k][c];
                }
        }
        if (!solve3(best, m, y) || v_len(best) > .5 * FAR_AWAY * f->size || best[2] < 0) return;
        memcpy(x, best, sizeof best);
        const double s2 = misfit(x, mine, w, l, f) / fmax(1, n - 2), unit[3] = {0, 0, 1};
        if (solve3(best, m, unit)) *sigma = sqrt(fmax(0, s2 * fmax(0, best[2])));
    }
}

/* Whether the rays are as well parallel: then the lamp stands at infinity. */
static int parallel(double x[3], const int *mine, const double *w, const bloblist *l, const lightfield *f,
                    double sigma)
{
    double mean[3] = {0, 0, 0}, far[3];
    const double middle[3] = {f->len_u / 2, f->len_v / 2, 0};

    for (int k = 0; k < f->n; k++)
        for (int c = 0; c < 3 && mine[k] >= 0; c++) mean[c] += w[k] * l->b[mine[k]].dir[c];
    v_unit(mean);
    for (int c = 0; c < 3; c++) far[c] = middle[c] + FAR_AWAY * f->size * mean[c];
    const double here = misfit(x, mine, w, l, f), there = misfit(far, mine, w, l, f);
    if (v_len(x) < 20 * f->size && there > 1.5 * here && sigma < .3 * v_len(x)) return 0;
    if (there > 1.5 * here && v_len(x) < .4 * FAR_AWAY * f->size) return 0;
    memcpy(x, far, sizeof far);
    return 1;
}

static int best_meeting(double x[3], int *mine, const bloblist *l, int first, const lightfield *f)
{
    const blob *a = &l->b[first];
    int best = 0, others = 0, step;
    double y[3];

    for (int i = 0; i < l->n; i++) others += l->b[i].lamp == -1 && l->b[i].probe != a->probe;
    step = others > 6 * TRIES ? others / (6 * TRIES) : 1;
    for (int i = 0, k = 0; i < l->n; i++) {
        const blob *b = &l->b[i];
        if (b->lamp != -1 || b->probe == a->probe || k++ % step) continue;
        if (!meet(y, f->pos[a->probe], a->dir, f->pos[b->probe], b->dir, FAR_AWAY * f->size)) continue;
        const int n = support(mine, y, l, f);
        if (n > best) best = n, memcpy(x, y, sizeof y);
    }
    return best;
}

static int brightest(const bloblist *l)
{
    int best = -1;

    for (int i = 0; i < l->n; i++)
        if (l->b[i].lamp == -1 && (best < 0 || l->b[i].flux > l->b[best].flux)) best = i;
    return best;
}

static int by_brightness(const void *a, const void *b)
{
    const double x = ((const centre *)a)->brightest, y = ((const centre *)b)->brightest;

    return (x < y) - (x > y);
}

int centres_find(centre *c, int most, bloblist *l, const lightfield *f)
{
    int *mine = malloc((size_t)f->n * sizeof *mine), found = 0, misses = 0;
    double *w = malloc((size_t)f->n * sizeof *w);

    while (mine && w && found < most && misses < 200) {
        const int first = brightest(l);
        centre x = {{0}, 0, 0, 0, 0};
        if (first < 0) break;
        if (best_meeting(x.at, mine, l, first, f) < LEAST_PROBES) {
            l->b[first].lamp = -2, misses++;
            continue;
        }
        for (int round = 0; round < 3; round++) {
            x.seen = support(mine, x.at, l, f);
            refine(x.at, &x.sigma, mine, w, l, f);
        }
        x.far = parallel(x.at, mine, w, l, f, x.sigma);
        x.seen = support(mine, x.at, l, f);
        if (x.seen < LEAST_PROBES) {
            l->b[first].lamp = -2, misses++;
            continue;
        }
        for (int k = 0; k < f->n; k++)
            if (mine[k] >= 0) {
                double e[3];
                v_sub(e, x.at, f->pos[k]);
                l->b[mine[k]].lamp = found;
                x.brightest = fmax(x.brightest, l->b[mine[k]].flux * v_dot(e, e));
            }
        if (l->b[first].lamp == -1) l->b[first].lamp = -2;
        c[found++] = x;
    }
    for (int i = 0; i < found; i++) c[i].seen += 1000000 * i; /* old number rides along through the sort */
    qsort(c, (size_t)found, sizeof *c, by_brightness);
    int *turn = malloc((size_t)(found + 1) * sizeof *turn);
    for (int i = 0; turn && i < found; i++) turn[c[i].seen / 1000000] = i, c[i].seen %= 1000000;
    for (int i = 0; turn && i < l->n; i++)
        if (l->b[i].lamp >= 0) l->b[i].lamp = turn[l->b[i].lamp];
    free(turn), free(mine), free(w);
    return found;
}

void centres_again(centre *c, int number, const bloblist *l, const lightfield *f)
{
    int *mine = malloc((size_t)f->n * sizeof *mine);
    double *w = malloc((size_t)f->n * sizeof *w);

    for (int k = 0; mine && k < f->n; k++) mine[k] = -1;
    for (int i = 0; mine && i < l->n; i++)
        if (l->b[i].lamp == number) mine[l->b[i].probe] = i;
    if (mine && w && !c->far) refine(c->at, &c->sigma, mine, w, l, f);
    free(mine), free(w);
}
