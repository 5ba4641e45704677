/*
 * lamp.c - what each probe measured of a lamp, and how it is taken out of the texels.
 */
#include "lamp.h"

#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { MOST_SIDE = 4, FINEST = 12, ACROSS = 12 };

/* Sums of one probe's parts of the lamp. */
typedef struct parts {
    int side; /* side*side parts */
    double light[MOST_SIDE * MOST_SIDE], full[MOST_SIDE * MOST_SIDE];
    double (*dir[MOST_SIDE * MOST_SIDE])[3]; /* directions that meet the part */
    int n[MOST_SIDE * MOST_SIDE], room;
} parts;

static int bounded(double x, int side)
{
    const int k = (int)floor((x + 1) / 2 * side);

    return k < 0 ? 0 : k >= side ? side - 1 : k;
}

/* The rays of a texel that meet the lamp go to the part that the texel's middle lies in. */
static void add_texel(parts *p, const patch *a, int i, const lightfield *f, const ilf_luminaire *l,
                      const double m[3], const double x[3], const double y[3], double cone, int S, double A)
{
    const int col = a->at[i] % f->nt, line = a->at[i] / f->nt;
    double d[3], t;

    lf_direction(d, f, a->probe, col + .5, line + .5);
    const double u = v_dot(d, x) / v_dot(d, m) / cone, v = v_dot(d, y) / v_dot(d, m) / cone;
    const int k = bounded(v, p->side) * p->side + bounded(u, p->side);
    double hits = 0, all = 0;
    for (int q = 0; q < S * S; q++) {
        const double py = line + (q / S + .5) / S, s = sin(py * f->dp);
        lf_direction(d, f, a->probe, col + (q % S + .5) / S, py);
        all += s;
        if (!ilf_luminaire_hit(&t, l, f->pos[a->probe], d)) continue;
        hits += s;
        if (p->n[k] < p->room) memcpy(p->dir[k][p->n[k]++], d, sizeof d);
    }
    if (hits <= 0) return;
    p->light[k] += a->sr[i] * a->lum[i];
    p->full[k] += a->sr[i] * hits / all * (A - a->ring_lum);
}

static void make_rows(lamp *l, const parts *p, int probe)
{
    double all = 0, light = 0;

    for (int k = 0; k < p->side * p->side; k++) all += p->full[k], light += p->light[k];
    l->seen[probe] = all > 0 ? light / all : -1;
    for (int k = 0; k < p->side * p->side; k++) {
        if (p->n[k] < 1 || p->full[k] < .004 * all) continue;
        row *r = &l->rows[l->nrows++];
        r->probe = probe, r->value = p->light[k] / p->full[k], r->share = p->full[k] / all;
        r->n = p->n[k] < ROW_SAMPLES ? p->n[k] : ROW_SAMPLES;
        for (int q = 0; q < r->n; q++)
            memcpy(r->dir[q], p->dir[k][(int)((q + .5) * p->n[k] / r->n)], sizeof r->dir[q]);
    }
}

/* Directions that meet the lamp, all over it. */
static void all_over(parts *p, const ilf_luminaire *l, const double o[3], double cone)
{
    double m[3], x[3], y[3], t;

    v_sub(m, l->centre, o);
    v_unit(m), v_basis(x, y, m);
    for (int k = 0; k < ACROSS * ACROSS; k++) {
        const double u = tan(fmin(1.5, cone)) * (2 * (k % ACROSS + .5) / ACROSS - 1),
                     v = tan(fmin(1.5, cone)) * (2 * (k / ACROSS + .5) / ACROSS - 1);
        double d[3];
        for (int c = 0; c < 3; c++) d[c] = m[c] + u * x[c] + v * y[c];
        v_unit(d);
        if (ilf_luminaire_hit(&t, l, o, d)) memcpy(p->dir[0][p->n[0]++], d, sizeof d);
    }
}

/* A blurred picture doesn't say which part of the lamp light comes from: one measurement, all light near it. */
static void measure_blurred(lamp *l, parts *p, const patch *a, const lightfield *f, int probe)
{
    const double *o = f->pos[probe];

    p->side = 1, p->light[0] = 0, p->n[0] = 0;
    p->full[0] = ilf_luminaire_omega(&l->s.l, o) * (l->s.radiance - a->ring_lum);
    for (int i = 0; i < a->n; i++) p->light[0] += a->sr[i] * a->lum[i];
    all_over(p, &l->s.l, o, ilf_luminaire_cone(&l->s.l, o));
    make_rows(l, p, probe);
}

static int measure_probe(lamp *l, parts *p, const lightfield *f, int probe, double limit)
{
    double m[3], x[3], y[3];
    patch a;
    const double cone = ilf_luminaire_cone(&l->s.l, f->pos[probe]);

    l->seen[probe] = -1;
    if (patch_make(&a, f, probe, l->s.l.centre, cone, 1.2, limit)) return -1;
    if (!a.n) return 0;
    v_sub(m, l->s.l.centre, f->pos[probe]);
    v_unit(m), v_basis(x, y, m);
    if (f->blur > 0) return measure_blurred(l, p, &a, f, probe), patch_free(&a), 0;
    const double texels = cone / patch_texel(f, m);
    p->side = texels > 4 ? 4 : 2;
    memset(p->light, 0, sizeof p->light), memset(p->full, 0, sizeof p->full), memset(p->n, 0, sizeof p->n);
    for (int i = 0; i < a.n; i++)
        add_texel(p, &a, i, f, &l->s.l, m, x, y, tan(fmin(1.5, cone)),
                  texels > 6   ? 4
                  : texels > 3 ? 6
                               : FINEST,
                  l->s.radiance);
    make_rows(l, p, probe);
    patch_free(&a);
    return 0;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Shares are made to be 1 where most probes see all of the lamp; its radiance takes the difference (what a
 * lens spreads beyond the outline stays in the field). */
static void level(lamp *l, const lightfield *f)
{
    double *v = malloc((size_t)f->n * sizeof *v);
    int n = 0;

    for (int k = 0; v && k < f->n; k++)
        if (l->seen[k] > .9 && l->seen[k] < 1.1) v[n++] = l->seen[k];
    if (n >= 3) {
        qsort(v, (size_t)n, sizeof *v, by_value);
        const double one = v[n / 2];
        for (int k = 0; k < f->n; k++)
            if (l->seen[k] >= 0) l->seen[k] /= one;
        for (int k = 0; k < l->nrows; k++) l->rows[k].value /= one;
        for (int c = 0; c < 3; c++) l->s.l.rgb[c] *= (float)one;
        l->s.radiance *= one;
    }
    free(v);
}

int lamp_measure(lamp *l, const lightfield *f, double limit, errmsg *e)
{
    parts p = {.room = 1 << 14};
    double *dirs = malloc(MOST_SIDE * MOST_SIDE * (size_t)p.room * 3 * sizeof *dirs);
    int bad = 0;

    l->rows = malloc((size_t)f->n * MOST_SIDE * MOST_SIDE * sizeof *l->rows);
    l->seen = malloc((size_t)f->n * sizeof *l->seen);
    bad = !dirs || !l->rows || !l->seen;
    for (int k = 0; dirs && k < MOST_SIDE * MOST_SIDE; k++)
        p.dir[k] = (double(*)[3])(dirs + (size_t)k * (size_t)p.room * 3);
    for (int k = 0; k < f->n && !bad; k++) {
        bad = measure_probe(l, &p, f, k, limit);
        l->width = fmax(l->width, 2 * ilf_luminaire_cone(&l->s.l, f->pos[k]));
    }
    free(dirs);
    if (bad) return err_set(e, "no memory for a lamp's measurements");
    level(l, f);
    return 0;
}

/* Fill texels from those around them: the smoothest picture (Laplace's equation), by relaxation. */
static void smooth_in(lightfield *f, int probe, const int *at, int n, const double ring[3])
{
    for (int i = 0; i < n; i++) {
        float *t = lf_texel(f, probe, at[i] % f->nt, at[i] / f->nt);
        for (int c = 0; c < 3; c++) t[c] = (float)ring[c];
    }
    for (int round = 0; round < 60; round++)
        for (int k = 0; k < n; k++) {
            const int i = round & 1 ? n - 1 - k : k;
            double sum[3] = {0, 0, 0};
            int m = 0;
            for (int q = 0; q < 4; q++) {
                int x = at[i] % f->nt, y = at[i] / f->nt;
                if (!lf_beside(&x, &y, f, q == 0 ? 1 : q == 1 ? -1 : 0, q == 2 ? 1 : q == 3 ? -1 : 0))
                    continue;
                for (int c = 0; c < 3; c++) sum[c] += (double)lf_texel(f, probe, x, y)[c];
                m++;
            }
            for (int c = 0; c < 3 && m; c++)
                lf_texel(f, probe, at[i] % f->nt, at[i] / f->nt)[c] = (float)(sum[c] / m);
        }
}

static int keep(lamp *l, const lightfield *f, int probe, const int *at, const double *cover, int n)
{
    const size_t have = (size_t)l->nfilled, more = have + (size_t)n;
    size_t *filled = realloc(l->filled, (more + 1) * sizeof *filled);
    float *was = filled ? realloc(l->was, (more + 1) * 4 * sizeof *was) : NULL;

    if (filled) l->filled = filled;
    if (was) l->was = was;
    if (!was) return -1;
    for (int i = 0; i < n; i++) {
        filled[have + (size_t)i] = (size_t)probe * (size_t)(f->np * f->nt) + (size_t)at[i];
        memcpy(was + 4 * (have + (size_t)i), lf_texel(f, probe, at[i] % f->nt, at[i] / f->nt),
               3 * sizeof *was);
        was[4 * (have + (size_t)i) + 3] = (float)cover[i];
    }
    l->nfilled = (int)more;
    return 0;
}

/* A texel shows some of the lamp where it is brighter than its surroundings. */
int lamp_take_out(lamp *l, lightfield *f, double limit, errmsg *e)
{
    for (int k = 0; k < f->n; k++) {
        patch p;
        int n = 0;
        if (patch_make(&p, f, k, l->s.l.centre, ilf_luminaire_cone(&l->s.l, f->pos[k]), 1.5, limit))
            return err_set(e, "no memory for a lamp's texels");
        patch_cover(&p, f, &l->s.l, 6);
        for (int i = 0; i < p.n; i++)
            if (p.lum[i] > (p.cover[i] > 0 ? .3 : 2) * p.ring_lum)
                p.at[n] = p.at[i], p.cover[n++] = p.cover[i];
        if (n && keep(l, f, k, p.at, p.cover, n)) {
            patch_free(&p);
            return err_set(e, "no memory for a lamp's texels");
        }
        if (n) smooth_in(f, k, p.at, n, p.ring);
        patch_free(&p);
    }
    return 0;
}

void lamp_put_back(lamp *l, lightfield *f)
{
    for (int i = 0; i < l->nfilled; i++)
        memcpy(f->rgb + 3 * l->filled[i], l->was + 4 * i, 3 * sizeof *l->was);
    l->nfilled = 0;
}

void lamp_free(lamp *l)
{
    free(l->rows), free(l->seen), free(l->filled), free(l->was);
    for (int k = 0; k < l->s.l.nmasks; k++) free(l->s.l.masks[k].grid);
    free(l->s.l.masks);
    memset(l, 0, sizeof *l);
}
