/*
 * steady.c - see steady.h.
 *
 * A body that all of a probe's light comes from lies d off where it should, in two angles across the direction e
 * to it: Gauss-Newton on the texels, amplitude free.  The turn w that brings it there obeys w x e = -d; all
 * lamps of a probe together, each by its own error, with turns about 0 as what is expected beforehand.
 */
#include "steady.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { LEAST = 6, ROUNDS = 4, RAYS = 8 };
#define ALL_OF_IT .9  /* of the largest flux x distance^2: nothing hides the lamp */
#define MOST_OFF  1.5 /* texels; more is another thing */
#define STEP      .2  /* texels, of the derivative */
#define FINEST    .04 /* texels: what area means of texels leave unknown */
#define LOOKS     .35 /* own misfit of a picture that shows the body */
#define CHANCE    2.5 /* standard errors that turns must be beyond on the average */
#define AWAY      .1  /* texels of turn that matter */
#define BEACON    .1  /* of the brightest lamp's light on the plane: dimmer spots may be anything */

/* One body as one probe sees it. */
typedef struct aim {
    int probe;
    double dir[3], t[2][3]; /* to its centre, and across */
    double off[2], error;   /* radians */
} aim;

/* ---- one body in one picture ---------------------------------------------------------------------- */

static void moved(ilf_luminaire *l, const ilf_luminaire *from, const aim *a, const double off[2],
                  const lightfield *f)
{
    double e[3];

    v_sub(e, from->centre, f->pos[a->probe]);
    const double dist = v_len(e);
    *l = *from;
    for (int c = 0; c < 3; c++) l->centre[c] += dist * (off[0] * a->t[0][c] + off[1] * a->t[1][c]);
}

/* Residuals with the best amplitude; returns their sum of squares over that of the light. */
static double residuals(double *r, double *amplitude, patch *p, const lightfield *f, const ilf_luminaire *l)
{
    double yc = 0, cc = 1e-30, yy = 1e-30, sum = 0;

    patch_cover(p, f, l, RAYS);
    for (int j = 0; j < p->n; j++) {
        yc += p->sr[j] * p->lum[j] * p->cover[j];
        cc += p->sr[j] * p->cover[j] * p->cover[j], yy += p->sr[j] * p->lum[j] * p->lum[j];
    }
    *amplitude = yc / cc;
    for (int j = 0; j < p->n; j++) {
        r[j] = sqrt(p->sr[j]) * (p->lum[j] - *amplitude * p->cover[j]);
        sum += r[j] * r[j];
    }
    return sum / yy;
}

/* Two unknowns' step from their normal equations; 0 if they say nothing. */
static int step_of(double d[2], double *error, const double *r, const double *const col[2], int n)
{
    double a = 0, b = 0, c = 0, y0 = 0, y1 = 0, sum = 0;

    for (int j = 0; j < n; j++) {
        a += col[0][j] * col[0][j], b += col[0][j] * col[1][j], c += col[1][j] * col[1][j];
        y0 -= col[0][j] * r[j], y1 -= col[1][j] * r[j], sum += r[j] * r[j];
    }
    const double det = a * c - b * b;
    if (!(det > 1e-6 * a * c) || n < 5) return 0;
    d[0] = (c * y0 - b * y1) / det, d[1] = (a * y1 - b * y0) / det;
    *error = sqrt(sum / (n - 3) * .5 * (a + c) / det);
    return 1;
}

/* Where the body lies; 0 if the picture doesn't show it so. */
static int aim_at(aim *a, patch *p, const lightfield *f, const ilf_luminaire *l)
{
    const double texel = patch_texel(f, a->dir), h = STEP * texel;
    double *r = malloc(3 * (size_t)(p->n + 1) * sizeof *r), d[2], misfit = 1, q;
    const double *const col[2] = {r + p->n, r + 2 * p->n};
    ilf_luminaire b;
    int known = r != NULL;

    a->off[0] = a->off[1] = 0;
    for (int round = 0; round < ROUNDS && known; round++) {
        moved(&b, l, a, a->off, f);
        misfit = residuals(r, &q, p, f, &b);
        for (int i = 0; i < 2; i++) {
            const double off[2] = {a->off[0] + (i ? 0 : h), a->off[1] + (i ? h : 0)};
            double *to = r + (i + 1) * p->n;
            moved(&b, l, a, off, f);
            residuals(to, &q, p, f, &b);
            for (int j = 0; j < p->n; j++) to[j] = (to[j] - r[j]) / h;
        }
        known = step_of(d, &a->error, r, col, p->n);
        for (int i = 0; i < 2 && known; i++) a->off[i] += fmax(-texel, fmin(texel, d[i]));
    }
    free(r);
    a->error = hypot(a->error, FINEST * texel);
    return known && sqrt(misfit) < LOOKS && hypot(a->off[0], a->off[1]) < MOST_OFF * texel;
}

/* ---- all of them ---------------------------------------------------------------------------------- */

static int by_flux(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x < y) - (x > y);
}

static double flux_of(const blob *b, const ilf_luminaire *l, const lightfield *f)
{
    double e[3];

    v_sub(e, l->centre, f->pos[b->probe]);
    return b->flux * v_dot(e, e);
}

/* The largest flux x distance^2 of a lamp's spots, but for a fifth (other light may stand beside it). */
static double brightest(const bloblist *list, int number, const ilf_luminaire *l, const lightfield *f)
{
    double *v = malloc((size_t)(list->n + 1) * sizeof *v), top = 0;
    int n = 0;

    for (int i = 0; v && i < list->n; i++)
        if (list->b[i].lamp == number) v[n++] = flux_of(&list->b[i], l, f);
    if (n) qsort(v, (size_t)n, sizeof *v, by_flux), top = v[n / 5];
    free(v);
    return top;
}

/* What the pictures say of body number i; returns how many aims there are now, or -1. */
static int listen(aim *all, int n, const lightfield *f, const bloblist *list, const shape *s, int i,
                  double limit)
{
    const double least = ALL_OF_IT * brightest(list, i, &s->l, f);

    for (int k = 0; k < list->n; k++) {
        const blob *b = &list->b[k];
        aim *a = &all[n];
        patch p;
        if (b->lamp != i || flux_of(b, &s->l, f) < least) continue;
        a->probe = b->probe;
        v_sub(a->dir, s->l.centre, f->pos[b->probe]);
        v_unit(a->dir), v_basis(a->t[0], a->t[1], a->dir);
        if (patch_make(&p, f, b->probe, s->l.centre, ilf_luminaire_cone(&s->l, f->pos[b->probe]), 3, limit))
            return -1;
        n += p.n > 0 && aim_at(a, &p, f, &s->l);
        patch_free(&p);
    }
    return n;
}

/* The turn that a probe's aims ask for, if turns are about `expected` in size; its error. */
static double turn_of(double w[3], const aim *all, int n, int probe, double expected)
{
    double m[3][3] = {{0}}, y[3] = {0}, error = 0;
    int aims = 0;

    for (int c = 0; c < 3; c++) m[c][c] = 1 / (expected * expected), w[c] = 0;
    for (int k = 0; k < n; k++) {
        const aim *a = &all[k];
        if (a->probe != probe) continue;
        const double wt = 1 / (a->error * a->error);
        for (int i = 0; i < 2; i++) { /* t . (w x e) = w . (e x t) = -off */
            double g[3];
            v_cross(g, a->dir, a->t[i]);
            for (int r = 0; r < 3; r++) {
                y[r] -= wt * g[r] * a->off[i];
                for (int c = 0; c < 3; c++) m[r][c] += wt * g[r] * g[c];
            }
        }
        aims++, error += wt;
    }
    if (!aims) return 0;
    for (int k = 0; k < 3; k++) /* positive definite: no pivots */
        for (int r = k + 1; r < 3; r++) {
            const double q = m[r][k] / m[k][k];
            for (int c = k; c < 3; c++) m[r][c] -= q * m[k][c];
            y[r] -= q * y[k];
        }
    for (int k = 3; k-- > 0;) {
        w[k] = y[k];
        for (int c = k + 1; c < 3; c++) w[k] -= m[k][c] * w[c];
        w[k] /= m[k][k];
    }
    return sqrt(1 / error);
}

static int frames(lightfield *f)
{
    static const double own[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

    if (f->turn) return 0;
    f->turn = malloc((size_t)f->n * sizeof *f->turn);
    for (int k = 0; f->turn && k < f->n; k++) memcpy(f->turn[k], own, sizeof own);
    return f->turn ? 0 : -1;
}

static void put_right(lightfield *f, bloblist *list, int probe, const double w[3])
{
    double axis[3] = {w[0], w[1], w[2]};
    const double angle = v_unit(axis);

    for (int i = 0; i < 3; i++) v_rotate(f->turn[probe] + 3 * i, axis, angle);
    for (int i = 0; i < list->n; i++)
        if (list->b[i].probe == probe) v_rotate(list->b[i].dir, axis, angle);
}

/* Their size on the average, noise taken off; how many standard errors beyond chance, and texels. */
static double size_of(double *beyond, double *texels, const aim *all, int n, const lightfield *f)
{
    double sum = 0, noise = 0, texel = 0;

    for (int k = 0; k < n; k++) {
        sum += (all[k].off[0] * all[k].off[0] + all[k].off[1] * all[k].off[1]) / (2 * n);
        noise += all[k].error * all[k].error / n, texel += patch_texel(f, all[k].dir) / n;
    }
    *beyond = sqrt(sum / noise), *texels = sqrt(sum) / texel;
    return sqrt(fmax(sum - noise, 1e-12));
}

/* Light of a lamp's brightest spot on the plane. */
static double on_plane(const bloblist *list, int number)
{
    double most = 0;

    for (int i = 0; i < list->n; i++)
        if (list->b[i].lamp == number) most = fmax(most, list->b[i].flux * list->b[i].dir[2]);
    return most;
}

int steady_put_right(steadied *it, lightfield *f, bloblist *list, const shape *s, int n, double limit)
{
    aim *all = malloc((size_t)(list->n + 1) * sizeof *all);
    int many = 0, aims = all ? 0 : -1;
    double sum = 0, error = 0, beyond, texels, most = 0;

    for (int i = 0; i < n; i++) most = fmax(most, s[i].misfit >= 0 ? on_plane(list, i) : 0);
    memset(it, 0, sizeof *it);
    for (int i = 0; i < n && aims >= 0; i++)
        if (s[i].misfit >= 0 && on_plane(list, i) > BEACON * most)
            aims = listen(all, aims, f, list, &s[i], i, limit);
    if (aims < LEAST) return free(all), aims < 0 ? -1 : 0;
    const double size = size_of(&beyond, &texels, all, aims, f);
    if (beyond < CHANCE || texels < AWAY) return free(all), 0;
    if (frames(f)) return free(all), -1;
    for (int k = 0; k < f->n; k++) {
        double w[3];
        const double own = turn_of(w, all, aims, k, size);
        if (!(own > 0)) continue;
        put_right(f, list, k, w);
        many++, sum += v_dot(w, w), error += own * own;
    }
    it->measured = many, it->turn = sqrt(sum / many), it->sure = sqrt(error / many);
    free(all);
    return 1;
}
