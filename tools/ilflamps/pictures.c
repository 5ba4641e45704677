/*
 * pictures.c - what stands in front of the walls in each probe's picture.
 */
#include "pictures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { WITNESSES = 15, SAMPLES = 200000 };
/* Part of a texel's darkening that counts as all: what is thinner than a texel must not vanish. */
#define PART .4
/* z of directions looked at: lower ones hardly matter, and walls are seen obliquely. */
#define LOWEST .15
/* Walls darker than this times what hides don't tell. */
#define TELLS 1.6

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* A texel's luminance is looked for among those that other probes see at the same place of the wall. */
static int behind(double *wall, const lightfield *f, const surroundings *s, int probe, int k)
{
    double d[3], x[3], v[WITNESSES];
    int n = 0;

    lf_direction(d, f, probe, k % f->nt + .5, k / f->nt + .5);
    if (d[2] < LOWEST) return 0;
    surroundings_meet(x, s, f->pos[probe], d);
    for (int w = 0; w < WITNESSES; w++) {
        const int q = (probe + 1 + w * (f->n > WITNESSES ? f->n / WITNESSES : 1) + (w * w) % 3) % f->n;
        double e[3], px, py;
        v_sub(e, x, f->pos[q]);
        if (q == probe || e[2] < .1 * v_len(e)) continue;
        lf_place(&px, &py, f, q, e);
        v[n++] = lf_look(f, q, px, py);
    }
    if (n < 3) return 0;
    qsort(v, (size_t)n, sizeof *v, by_value);
    *wall = fmax(1e-12, v[n / 2]);
    return 1;
}

/* How dark what hides is: over the wall (lower quartile of texels that are clearly darker than it), and
 * itself (upper quartile), from a part of the texels. */
static int darkness(double *part, double *itself, const lightfield *f, const surroundings *s)
{
    const size_t all = (size_t)f->n * (size_t)f->nt * (size_t)f->np, step = all / SAMPLES + 1;
    double *v = malloc(2 * SAMPLES * sizeof *v), *own = v + SAMPLES, wall;
    int n = 0;

    *part = .3, *itself = 0;
    if (!v) return -1;
    for (size_t i = 0; i < all; i += step) {
        const size_t texels = (size_t)f->nt * (size_t)f->np;
        const int probe = (int)(i / texels), k = (int)((i * 7919) % texels);
        const double lum = lf_lum(f, probe, k % f->nt, k / f->nt);
        if (behind(&wall, f, s, probe, k) && lum < .6 * wall) v[n] = lum / wall, own[n++] = lum;
    }
    if (n > 100) {
        qsort(v, (size_t)n, sizeof *v, by_value), qsort(own, (size_t)n, sizeof *own, by_value);
        *part = v[n / 4], *itself = own[3 * n / 4];
    }
    free(v);
    return 0;
}

int pictures_make(pictures *p, const lightfield *f, const surroundings *around, errmsg *e)
{
    const size_t texels = (size_t)f->nt * (size_t)f->np;
    double itself;

    memset(p, 0, sizeof *p);
    p->nt = f->nt, p->np = f->np, p->around = around;
    p->opacity = malloc((size_t)f->n * texels * sizeof *p->opacity);
    if (!p->opacity || darkness(&p->dark, &itself, f, around))
        return err_set(e, "no memory for pictures of what hides");
#pragma omp parallel for schedule(dynamic, 1)
    for (int q = 0; q < f->n; q++)
        for (int k = 0; k < f->nt * f->np; k++) {
            double wall;
            float *o = p->opacity + (size_t)q * texels + (size_t)k;
            *o = -1;
            if (!behind(&wall, f, around, q, k) || wall < TELLS * itself) continue;
            const double ratio = lf_lum(f, q, k % f->nt, k / f->nt) / wall;
            *o = (float)fmax(0, fmin(1, (1 - ratio) / (1 - p->dark) / PART));
        }
    return 0;
}

double pictures_look(const pictures *p, int probe, double x, double y)
{
    const float *o = p->opacity + (size_t)probe * (size_t)(p->np * p->nt);
    int i = (int)(x + (double)p->nt - .5), j = (int)(y - .5);
    const double a = x + (double)p->nt - .5 - i;
    double b = y - .5 - j, sum = 0, all = 0;

    if (y < .5) j = 0, b = 0;
    if (j >= p->np - 1) j = p->np - 2, b = 1;
    for (int k = 0; k < 4; k++) {
        const double v = (double)o[(j + (k >> 1)) * p->nt + (i + (k & 1)) % p->nt],
                     w = (k & 1 ? a : 1 - a) * (k & 2 ? b : 1 - b);
        if (v >= 0) sum += w * v, all += w;
    }
    return all > .5 ? sum / all : -1;
}

void pictures_add_lamp(pictures *p, const lamp *l, const lightfield *f)
{
    for (int i = 0; i < l->nfilled; i++) {
        const float *was = l->was + 4 * i, *left = f->rgb + 3 * l->filled[i];
        if (was[3] < .3f) continue;
        const double share = (ilf_luminance(was) - ilf_luminance(left)) /
                             ((double)was[3] * (l->s.radiance - ilf_luminance(left)));
        p->opacity[l->filled[i]] = (float)fmax(0, fmin(1, (1 - share) / PART));
    }
}

void pictures_free(pictures *p)
{
    free(p->opacity);
    memset(p, 0, sizeof *p);
}
