/*
 * views.c - see views.h.
 */
#include "views.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RIM = 2 }; /* texels round a lamp that have some of its light */

static int fill_finest(view *v, const lightfield *f, double limit)
{
    const size_t all = (size_t)f->np * (size_t)f->nt;

    *v = (view){f->nt, f->np, f->dt, f->dp, malloc((size_t)f->n * all * sizeof *v->lum)};
    if (!v->lum) return -1;
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < f->n; k++) {
        float *to = v->lum + (size_t)k * all;
        for (size_t i = 0; i < all; i++)
            to[i] = (float)fmax(1e-12, ilf_luminance(f->rgb + 3 * ((size_t)k * all + i)));
        for (size_t i = 0; i < all; i++) {
            if (f->unseen && f->unseen[(size_t)k * all + i]) to[i] = NAN;
            if (!(ilf_luminance(f->rgb + 3 * ((size_t)k * all + i)) > limit)) continue;
            for (int dy = -RIM; dy <= RIM; dy++)
                for (int dx = -RIM; dx <= RIM; dx++) {
                    int x = (int)(i % (size_t)f->nt), y = (int)(i / (size_t)f->nt);
                    if (lf_beside(&x, &y, f, dx, dy)) to[y * f->nt + x] = NAN;
                }
        }
    }
    return 0;
}

static int halve(view *to, const view *from, int n)
{
    *to = (view){from->nt / 2, from->np / 2, 2 * from->dt, 2 * from->dp, NULL};
    to->lum = malloc((size_t)n * (size_t)to->np * (size_t)to->nt * sizeof *to->lum);
    if (!to->lum) return -1;
#pragma omp parallel for schedule(static)
    for (int line = 0; line < n * to->np; line++) {
        const int k = line / to->np, y = line % to->np;
        const float *a = from->lum + ((size_t)k * (size_t)from->np + 2 * (size_t)y) * (size_t)from->nt;
        for (int x = 0; x < to->nt; x++)
            to->lum[(size_t)line * (size_t)to->nt + (size_t)x] =
                .25f * (a[2 * x] + a[2 * x + 1] + a[from->nt + 2 * x] + a[from->nt + 2 * x + 1]);
    }
    return 0;
}

int views_make(views *v, const lightfield *f, double limit, errmsg *e)
{
    memset(v, 0, sizeof *v);
    v->f = f, v->n = 1;
    int bad = fill_finest(&v->v[0], f, limit);
    while (!bad && v->n < LEVELS && v->v[v->n - 1].nt % 2 == 0 && v->v[v->n - 1].np >= 24) {
        bad = halve(&v->v[v->n], &v->v[v->n - 1], f->n);
        v->n++;
    }
    if (!bad) return 0;
    views_free(v);
    return err_set(e, "no memory for pictures to compare");
}

void views_free(views *v)
{
    for (int k = 0; k < v->n; k++) free(v->v[k].lum);
    memset(v, 0, sizeof *v);
}

double views_look(const views *all, int level, int probe, const double d[3])
{
    const view *v = &all->v[level];
    double x, y, sum = 0;

    lf_place(&x, &y, all->f, probe, d); /* the finest map's texels */
    x = x * all->f->dt / v->dt - .5, y = y * all->f->dp / v->dp - .5;
    if (y < 0) y = 0;
    if (y > v->np - 1) return NAN;
    const int i = (int)floor(x), j = (int)y < v->np - 1 ? (int)y : v->np - 2;
    const double a = x - i, b = y - j;
    const float *line = v->lum + ((size_t)probe * (size_t)v->np + (size_t)j) * (size_t)v->nt;
    for (int k = 0; k < 4; k++) {
        const double w = (k & 1 ? a : 1 - a) * (k & 2 ? b : 1 - b);
        const int at = (i + (k & 1) + v->nt) % v->nt;
        if (w > 0) sum += w * (double)line[(k >> 1) * v->nt + at];
    }
    return sum;
}
