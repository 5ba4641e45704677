/*
 * patch.c - the texels of a probe at and round a lamp, and what part of each the lamp covers.
 */
#include "patch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { MOST_RAYS = 64 };
#define TAILS     2.2 /* standard deviations of a blur that count */
#define MOST_BLUR 6.  /* texels that it is followed to (beside the pole they are narrow) */

double patch_texel(const lightfield *f, const double d[3])
{
    return fmax(f->dp, f->dt * sqrt(fmax(0, d[0] * d[0] + d[1] * d[1])));
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* Texels whose middle lies within `wide` of m, in rows' order.  Returns their number; at may be NULL. */
static int within(int *at, const lightfield *f, int probe, const double m[3], double wide)
{
    double own[3] = {m[0], m[1], m[2]};
    lf_inward(own, f, probe);
    const double phi = acos(fmax(-1, fmin(1, own[2]))),
                 theta = atan2(own[1], own[0]) + 3.14159265358979323846;
    const int y0 = (int)fmax(0, floor((phi - wide) / f->dp)),
              y1 = (int)fmin(f->np - 1, ceil((phi + wide) / f->dp));
    int n = 0;

    for (int y = y0; y <= y1; y++) {
        const double s = sin((y + .5) * f->dp);
        const double half = s > 1.01 * sin(fmin(wide, 1.5)) ? 2 * wide / s : 4;
        const int all = half / f->dt * 2 + 3 >= f->nt, first = all ? 0 : (int)floor((theta - half) / f->dt);
        const int last = all ? f->nt - 1 : (int)ceil((theta + half) / f->dt);
        for (int x = first; x <= last; x++) {
            double d[3];
            lf_direction(d, f, probe, x + .5, y + .5);
            if (v_dot(d, m) < cos(wide)) continue;
            if (at) at[n] = y * f->nt + ((x % f->nt) + f->nt) % f->nt;
            n++;
        }
    }
    return n;
}

static void set_ring(patch *p, const lightfield *f, const int *at, int n, const double m[3], double cone,
                     double limit)
{
    float *v = malloc((size_t)(n + 1) * 3 * sizeof *v);
    const double size = patch_texel(f, m);
    int k = 0;

    for (int i = 0; v && i < n; i++) {
        double d[3];
        const float *t = lf_texel(f, p->probe, at[i] % f->nt, at[i] / f->nt);
        lf_direction(d, f, p->probe, at[i] % f->nt + .5, at[i] / f->nt + .5);
        if (v_dot(d, m) > cos(cone + 1.5 * size) || ilf_luminance(t) > limit) continue;
        for (int c = 0; c < 3; c++) v[c * n + k] = t[c];
        k++;
    }
    for (int c = 0; c < 3 && k; c++) {
        qsort(v + c * n, (size_t)k, sizeof *v, by_value);
        p->ring[c] = (double)v[c * n + k / 2];
    }
    p->ring_lum = .265 * p->ring[0] + .67 * p->ring[1] + .065 * p->ring[2];
    free(v);
}

static int all_seen(const lightfield *f, int probe, const int *at, int n)
{
    for (int i = 0; i < n && f->unseen; i++)
        if (f->unseen[(size_t)probe * (size_t)f->np * (size_t)f->nt + (size_t)at[i]]) return 0;
    return 1;
}

int patch_make(patch *p, const lightfield *f, int probe, const double centre[3], double cone, double margin,
               double limit)
{
    double m[3];

    memset(p, 0, sizeof *p);
    p->probe = probe;
    v_sub(m, centre, f->pos[probe]);
    v_unit(m);
    cone += TAILS * f->blur;
    const double size = patch_texel(f, m), wide = cone + margin * size, ring = cone + 3.5 * size;
    if (m[2] <= 0 || wide > 1.5) return 0;
    const int most = within(NULL, f, probe, m, fmax(wide, ring));
    int *at = malloc((size_t)(most + 1) * sizeof *at);
    double *v = malloc(3 * (size_t)(most + 1) * sizeof *v);
    if (!at || !v) {
        free(at), free(v);
        return -1;
    }
    within(at, f, probe, m, fmax(wide, ring));
    set_ring(p, f, at, most, m, cone, limit);
    p->n = within(at, f, probe, m, wide);
    if (!all_seen(f, probe, at, p->n)) {
        free(at), free(v);
        return p->n = 0;
    }
    p->at = at, p->lum = v, p->sr = v + most + 1, p->cover = v + 2 * (most + 1);
    for (int i = 0; i < p->n; i++) {
        p->lum[i] = lf_lum(f, probe, at[i] % f->nt, at[i] / f->nt) - p->ring_lum;
        p->sr[i] = lf_texel_sr(f, at[i] / f->nt), p->cover[i] = 0;
    }
    return 0;
}

void patch_free(patch *p)
{
    free(p->at), free(p->lum), free(p->gain);
    memset(p, 0, sizeof *p);
}

/* Rays that stand for a texel along one of its sides: places in texels, and weights: those of the texel
 * itself, spread by a blur (in texels). */
typedef struct comb {
    int n;
    double at[MOST_RAYS], weight[MOST_RAYS];
} comb;

static void comb_make(comb *c, int S, double blur)
{
    const double reach = fmin(TAILS * blur, MOST_BLUR);

    c->n = (int)fmin(MOST_RAYS, ceil(S * (1 + 2 * reach)));
    for (int k = 0; k < c->n; k++) {
        const double u = (k + .5) / c->n * (1 + 2 * reach) - reach;
        c->at[k] = u;
        c->weight[k] = blur > 0 ? .5 * (erf(u / blur / sqrt(2)) - erf((u - 1) / blur / sqrt(2))) : 1;
    }
}

void patch_cover(patch *p, const lightfield *f, const ilf_luminaire *l, int S)
{
    const double *o = f->pos[p->probe], cone = ilf_luminaire_cone(l, o),
                 size = .75 * hypot(f->dp, f->dt) + 1.5 * TAILS * f->blur;
    double m[3], cs[MOST_RAYS], sn[MOST_RAYS];
    comb down, across;

    v_sub(m, l->centre, o);
    v_unit(m);
    comb_make(&down, S, f->blur / f->dp), comb_make(&across, S, 0);
    for (int i = 0; i < p->n; i++) {
        const int x = p->at[i] % f->nt, y = p->at[i] / f->nt;
        double d[3], t, sum = 0, all = 0;
        const ilf_luminaire *before = p->behind;
        lf_direction(d, f, p->probe, x + .5, y + .5);
        p->cover[i] = 0;
        if (v_dot(d, m) < cos(fmin(3, cone + size))) continue;
        if (f->blur > 0) comb_make(&across, S, f->blur / f->dt / sin((y + .5) * f->dp));
        for (int b = 0; b < across.n; b++) {
            const double az = (x + across.at[b]) * f->dt - 3.14159265358979323846;
            cs[b] = cos(az), sn[b] = sin(az);
        }
        for (int a = 0; a < down.n; a++) {
            const double p1 = (y + down.at[a]) * f->dp, s = sin(p1); /* below 0: beyond the pole */
            for (int b = 0; b < across.n; b++) {
                const double w = fabs(s) * down.weight[a] * across.weight[b];
                d[0] = s * cs[b], d[1] = s * sn[b], d[2] = cos(p1);
                lf_outward(d, f, p->probe);
                if (l->shape == ILF_SPHERE) { /* a ray stands for a small square, so that the cover is smooth
                                                 in the body's numbers */
                    const double g[3] = {d[0] - m[0], d[1] - m[1], d[2] - m[2]},
                                 wide = .5 * (f->dp + f->dt * fabs(s)) / S;
                    const double part = fmax(0, fmin(1, .5 + (cone - v_len(g)) / wide));
                    sum += w * (part > 0 && before ? part * ilf_luminaire_pass(before, o, d) : part);
                } else if (ilf_luminaire_hit(&t, l, o, d))
                    sum += before ? w * ilf_luminaire_pass(before, o, d) : w;
                all += w;
            }
        }
        p->cover[i] = sum / all * (p->gain ? p->gain[i] : 1);
    }
}
