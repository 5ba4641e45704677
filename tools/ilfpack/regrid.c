/*
 * regrid.c - see regrid.h.
 */
#include "regrid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/lamp.h"
#include "ilflamps/vec.h"

static const double pi = 3.14159265358979323846;

#define WIDTH  .7   /* of the Gaussian, mean distances between pictures */
#define HELD   .02  /* slopes are held back by this part of the weights */
#define LEAST  1e-4 /* smaller weights are none */
#define COARSE 24   /* rows of the pictures that are compared with each other */

/* ---- weights -------------------------------------------------------------------------------------- */

/* Distance of the third nearest picture, squared: a Gaussian must reach so far. */
static double third(const lightfield *f, double x, double y, int without)
{
    double d[3] = {1e300, 1e300, 1e300};

    for (int k = 0; k < f->n; k++) {
        double r = pow(f->pos[k][0] - x, 2) + pow(f->pos[k][1] - y, 2);
        for (int q = 0; q < 3 && k != without; q++)
            if (r < d[q]) {
                const double t = d[q];
                d[q] = r, r = t;
            }
    }
    return d[2] < 1e299 ? d[2] : d[1] < 1e299 ? d[1] : d[0] < 1e299 ? d[0] : 0;
}

/* First row of the inverse of a symmetric 3 x 3 matrix. */
static void first_row(double r[3], double m[3][3])
{
    const double c0 = m[1][1] * m[2][2] - m[1][2] * m[1][2], c1 = m[0][2] * m[1][2] - m[0][1] * m[2][2],
                 c2 = m[0][1] * m[1][2] - m[0][2] * m[1][1];
    const double det = m[0][0] * c0 + m[0][1] * c1 + m[0][2] * c2;

    r[0] = c0 / det, r[1] = c1 / det, r[2] = c2 / det;
}

void regrid_weights(double *w, const lightfield *f, double x, double y, int without)
{
    const double mean = sqrt(f->len_u * f->len_v / f->n), wide = WIDTH * mean;
    const double s2 = fmax(wide * wide, .5 * third(f, x, y, without));
    double m[3][3] = {{0}}, first[3], all = 0, sum = 0;

    for (int k = 0; k < f->n; k++) {
        const double phi[3] = {1, (f->pos[k][0] - x) / sqrt(s2), (f->pos[k][1] - y) / sqrt(s2)};
        w[k] = k == without ? 0 : exp(-.5 * (phi[1] * phi[1] + phi[2] * phi[2]));
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) m[r][c] += w[k] * phi[r] * phi[c];
        all += w[k];
    }
    m[1][1] += HELD * all, m[2][2] += HELD * all;
    first_row(first, m);
    for (int k = 0; k < f->n; k++) {
        w[k] *= first[0] + (first[1] * (f->pos[k][0] - x) + first[2] * (f->pos[k][1] - y)) / sqrt(s2);
        if (fabs(w[k]) < LEAST) w[k] = 0;
        sum += w[k];
    }
    for (int k = 0; k < f->n; k++) w[k] /= sum;
}

/* ---- resampling ----------------------------------------------------------------------------------- */

/* Radiance bilinear between texels. */
static void look(double rgb[3], const lightfield *f, int probe, const double d[3], double w)
{
    double x, y;

    lf_place(&x, &y, f, probe, d);
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;
    for (int k = 0; k < 4; k++) {
        int i = (int)fx, j = (int)fy < f->np - 1 ? (int)fy : f->np - 2;
        const double part = (k & 1 ? a : 1 - a) * (k & 2 ? b : 1 - b);
        if (!lf_beside(&i, &j, f, k & 1, k >> 1)) continue;
        const float *t = lf_texel(f, probe, i, j);
        for (int c = 0; c < 3; c++) rgb[c] += w * part * (double)t[c];
    }
}

/* What a place's pictures say about a direction there. */
static void join(double rgb[3], const lightfield *f, const surroundings *around, const double *w,
                 const double o[3], const double d[3])
{
    double h[3], e[3];

    rgb[0] = rgb[1] = rgb[2] = 0;
    surroundings_meet(h, around, o, d);
    for (int k = 0; k < f->n; k++) {
        if (!(fabs(w[k]) > 0)) continue;
        v_sub(e, h, f->pos[k]);
        look(rgb, f, k, e, w[k]);
    }
    for (int c = 0; c < 3; c++) rgb[c] = fmax(0, rgb[c]);
}

static int make_grid(lightfield *g, const lightfield *f, int nu, int nv, int nt, int np, errmsg *e)
{
    *g = *f;
    g->nu = nu, g->nv = nv, g->n = nu * nv, g->free = 0, g->turn = NULL, g->unseen = NULL;
    g->nt = nt, g->np = np, g->polar_max = pi / 2, g->dt = 2 * pi / nt, g->dp = pi / 2 / np;
    g->info.polar_max = g->info.polar_valid = pi / 2;
    g->pos = malloc((size_t)g->n * sizeof *g->pos);
    g->rgb = malloc((size_t)g->n * (size_t)np * (size_t)nt * 3 * sizeof *g->rgb);
    if (g->pos && g->rgb) return 0;
    lf_free(g);
    return err_set(e, "no memory for a grid of %dx%d probes", nu, nv);
}

static void node(double p[3], const lightfield *f, int k, int nu, int nv)
{
    p[0] = nu > 1 ? f->len_u * (k % nu) / (nu - 1) : f->len_u / 2;
    p[1] = nv > 1 ? f->len_v * (k / nu) / (nv - 1) : f->len_v / 2;
    p[2] = 0;
}

int regrid(lightfield *g, const lightfield *f, const surroundings *around, int nu, int nv, int nt, int np,
           errmsg *e)
{
    double *w = malloc((size_t)f->n * sizeof *w);

    if (!w) return err_set(e, "no memory for weights");
    if (make_grid(g, f, nu, nv, nt, np, e)) {
        free(w);
        return -1;
    }
    for (int k = 0; k < g->n; k++) {
        node(g->pos[k], f, k, nu, nv);
        regrid_weights(w, f, g->pos[k][0], g->pos[k][1], -1);
#pragma omp parallel for schedule(dynamic, 4)
        for (int y = 0; y < np; y++)
            for (int x = 0; x < nt; x++) {
                double d[3], rgb[3];
                lf_direction(d, g, LF_FIELD, x + .5, y + .5);
                join(rgb, f, around, w, g->pos[k], d);
                for (int c = 0; c < 3; c++) lf_texel(g, k, x, y)[c] = (float)rgb[c];
            }
    }
    free(w);
    return 0;
}

/* ---- how sure ------------------------------------------------------------------------------------- */

static double nearest(const lightfield *f, double x, double y, int without)
{
    double best = 1e300;

    for (int k = 0; k < f->n; k++)
        if (k != without) best = fmin(best, hypot(f->pos[k][0] - x, f->pos[k][1] - y));
    return best;
}

/* Irradiance from above at picture k's place: its own, and as the others say. */
static void compared(double E[2], const analysis *a, double *w, int k)
{
    const lightfield *f = &a->f;

    E[0] = E[1] = 0;
    regrid_weights(w, f, f->pos[k][0], f->pos[k][1], k);
    for (int q = 0; q < COARSE * 4 * COARSE; q++) {
        const double p = (q / (4 * COARSE) + .5) / COARSE * pi / 2,
                     t = (q % (4 * COARSE) + .5) / COARSE * pi / 2;
        const double d[3] = {sin(p) * cos(t), sin(p) * sin(t), cos(p)};
        double own[3] = {0, 0, 0}, others[3];
        look(own, f, k, d, 1);
        join(others, f, &a->around, w, f->pos[k], d);
        for (int c = 0; c < 3; c++) {
            const double lum = (c == 0 ? .265 : c == 1 ? .67 : .065) * sin(p) * cos(p);
            E[0] += lum * own[c], E[1] += lum * others[c];
        }
    }
    for (int c = 0; c < 2; c++) E[c] *= pow(pi / 2 / COARSE, 2);
}

/* Light of the lamps that were taken out, unhidden, and what of it is not sure, at a place of the plane. */
static void of_lamps(double *light, double *doubt, const analysis *a, const double o[3])
{
    *light = *doubt = 0;
    for (int i = 0; i < a->n; i++) {
        const found *it = &a->lamps[i];
        double m[3];
        if (it->fate != TAKEN) continue;
        v_sub(m, it->l.s.l.centre, o);
        const double E = it->l.s.radiance * ilf_luminaire_omega(&it->l.s.l, o) * fmax(0, m[2]) / v_len(m);
        *light += E, *doubt = hypot(*doubt, E * it->best.error);
    }
}

/* Relative error of what is left, per unit of distance from the nearest picture, and its mean irradiance. */
static int growth(double *rate, double *mean, const analysis *a, errmsg *e)
{
    const int n = a->f.n;
    double *w = malloc((size_t)n * sizeof *w), sum = 0;

    *rate = *mean = 0;
    if (!w) return err_set(e, "no memory for weights");
    for (int k = 0; k < n && n > 1; k++) {
        double E[2];
        compared(E, a, w, k);
        *mean += E[0] / n;
        sum +=
            pow((E[1] - E[0]) / fmax(1e-30, E[0]) / nearest(&a->f, a->f.pos[k][0], a->f.pos[k][1], k), 2) / n;
    }
    *rate = sqrt(sum);
    free(w);
    return 0;
}

int regrid_reach(reach *r, const analysis *a, int nu, int nv, errmsg *e)
{
    double rate, mean;

    if (growth(&rate, &mean, a, e)) return -1;
    for (int k = 0; k < nu * nv; k++) {
        double p[3], light, doubt;
        node(p, &a->f, k, nu, nv);
        r[k].at[0] = p[0], r[k].at[1] = p[1];
        r[k].nearest = nearest(&a->f, p[0], p[1], -1);
        of_lamps(&light, &doubt, a, p);
        r[k].error = hypot(rate * r[k].nearest * mean, doubt) / fmax(1e-30, mean + light);
    }
    return 0;
}
