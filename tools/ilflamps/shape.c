/*
 * shape.c - what a lamp looks like.  Second moments of its spots give a first size and orientation; then
 * spheres, rectangles, discs and tubes are fitted to the texels themselves (Levenberg-Marquardt on texel
 * values, each probe with an amplitude of its own), and the simplest that explains them is taken: a sphere
 * unless another is better by a tenth.
 */
#include "shape.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "moments.h"
#include "vec.h"

enum { MOST_PROBES = 32, PARAMS = 9 };

#define NEARLY .75 /* of the largest flux x distance^2: may be all of a lamp; the fit weeds */
#define ALL_BUT                                                                                              \
    .9 /* the same for lamps of many texels, whose shape a hidden corner spoils more than foreshortening */
#define ROUNDISH .2  /* rms misfit below which a sphere says which probes see all of the lamp */
#define DOUBT    .1  /* rms misfit above which those that see part of it are looked for */
#define SURE     .03 /* rms misfit below which a sphere needs no rival */

#define NEARLY_STRAIGHT .96 /* cosine of the angle that a straight body's normal may have been off */
#define AS_GOOD         1.5 /* misfit of a straight body, of a free one's */

/* centre 0-2, log sizes 3 and 4, turn about the frame's third axis 5, first 6, second 7 */
typedef struct trial {
    ilf_shape shape;
    double base[3][3], p[8];
    unsigned active; /* bit k: p[k] is fitted */
    double misfit;
} trial;

typedef struct work {
    const lightfield *f;
    patch *p;
    int n, S, texels;
    int together; /* one amplitude for all probes: what hides the lamp is known */
    double unit;  /* scale of the positions' steps: lamp's size */
} work;

static void body(ilf_luminaire *l, const trial *t)
{
    double e[3][3];

    memcpy(e, t->base, sizeof e);
    for (int k = 0; k < 3; k++)
        for (int v = 0; v < 3; v++) v_rotate(e[v], t->base[(k + 2) % 3], t->p[5 + k]);
    memset(l, 0, sizeof *l);
    l->shape = t->shape;
    const double a = exp(t->p[3]), b = t->shape == ILF_DISC ? a : exp(t->p[4]);
    for (int k = 0; k < 3; k++) l->centre[k] = t->p[k], l->a[k] = a * e[0][k], l->b[k] = b * e[1][k];
    l->radius = t->shape == ILF_SPHERE ? a : t->shape == ILF_TUBE ? b : 0;
}

/* Sums over a probe's texels: measured x expected, expected squared, measured squared. */
static void products(double s[3], const patch *p)
{
    for (int j = 0; j < p->n; j++) {
        s[0] += p->sr[j] * p->lum[j] * p->cover[j];
        s[1] += p->sr[j] * p->cover[j] * p->cover[j], s[2] += p->sr[j] * p->lum[j] * p->lum[j];
    }
}

/* Residuals of all texels (weights: square root of solid angle); returns their sum of squares. */
static double residuals(double *r, const trial *t, const work *w)
{
    ilf_luminaire l;
    double sum = 0;

    body(&l, t);
#pragma omp parallel for schedule(dynamic, 1)
    for (int i = 0; i < w->n; i++) patch_cover(&w->p[i], w->f, &l, w->S);
    double all[3] = {0, 1e-30, 1e-30};
    for (int i = 0; i < w->n && w->together; i++) products(all, &w->p[i]);
    for (int i = 0, k = 0; i < w->n; i++) {
        const patch *p = &w->p[i];
        double own[3] = {0, 1e-30, 1e-30};
        products(own, p);
        const double *q = w->together ? all : own, yy = w->together ? q[2] / w->n : q[2];
        for (int j = 0; j < p->n; j++, k++) {
            r[k] = sqrt(p->sr[j] / yy) * (p->lum[j] - q[0] / q[1] * p->cover[j]);
            sum += r[k] * r[k];
        }
    }
    return sum;
}

/* A few unknowns' normal equations, damped: a x = y; a is overwritten. */
static void solve(double *x, double a[PARAMS][PARAMS], const double *y, int n)
{
    double b[PARAMS];

    memcpy(b, y, (size_t)n * sizeof *b);
    for (int k = 0; k < n; k++)
        for (int r = k + 1; r < n; r++) {
            const double q = a[k][k] != 0 ? a[r][k] / a[k][k] : 0;
            for (int c = k; c < n; c++) a[r][c] -= q * a[k][c];
            b[r] -= q * b[k];
        }
    for (int k = n; k-- > 0;) {
        x[k] = b[k];
        for (int c = k + 1; c < n; c++) x[k] -= a[k][c] * x[c];
        x[k] = a[k][k] != 0 ? x[k] / a[k][k] : 0;
    }
}

static int fit(trial *t, const work *w)
{
    double *r = malloc((size_t)w->texels * (PARAMS + 1) * sizeof *r), damp = 1e-3;
    int list[PARAMS], n = 0;

    if (!r) return -1;
    for (int k = 0; k < 8; k++)
        if (t->active >> k & 1) list[n++] = k;
    t->misfit = residuals(r, t, w);
    for (int round = 0; round < 10; round++) {
        double JJ[PARAMS][PARAMS] = {{0}}, Jr[PARAMS] = {0}, step[PARAMS];
        for (int k = 0; k < n; k++) {
            double *col = r + (size_t)w->texels * (size_t)(k + 1);
            const double fine = t->shape == ILF_SPHERE ? .2 : 1,
                         h = fine * (list[k] < 3 ? .15 * w->unit : .08);
            trial q = *t;
            q.p[list[k]] += h;
            residuals(col, &q, w);
            for (int i = 0; i < w->texels; i++) col[i] = (col[i] - r[i]) / h, Jr[k] -= col[i] * r[i];
            for (int m = 0; m <= k; m++) {
                const double *other = r + (size_t)w->texels * (size_t)(m + 1);
                double sum = 0;
                for (int i = 0; i < w->texels; i++) sum += col[i] * other[i];
                JJ[k][m] = JJ[m][k] = sum;
            }
        }
        int better = 0;
        for (int tries = 0; tries < 4 && !better; tries++) {
            double a[PARAMS][PARAMS];
            trial q = *t;
            memcpy(a, JJ, sizeof a);
            for (int k = 0; k < n; k++) a[k][k] += damp * JJ[k][k] + 1e-12;
            solve(step, a, Jr, n);
            for (int k = 0; k < n; k++) q.p[list[k]] += list[k] < 3 ? step[k] : fmax(-.5, fmin(.5, step[k]));
            q.misfit = residuals(r + (size_t)w->texels, &q, w);
            better = q.misfit < t->misfit;
            damp *= better ? .3 : 8;
            if (better) {
                const int done = q.misfit > t->misfit * .9998;
                *t = q;
                memcpy(r, r + (size_t)w->texels, (size_t)w->texels * sizeof *r);
                if (done) round = 99;
            }
        }
        if (!better) break;
    }
    free(r);
    return 0;
}

/* Derivatives of the residuals by number k, on both sides; 0, or -1 without memory. */
static int derivative(double *col, const trial *t, const work *w, int k)
{
    double *low = malloc((size_t)w->texels * sizeof *low);
    const double h = k < 3 ? .05 * w->unit : .02;
    trial q = *t;

    if (!low) return -1;
    q.p[k] = t->p[k] + h, residuals(col, &q, w);
    q.p[k] = t->p[k] - h, residuals(low, &q, w);
    for (int i = 0; i < w->texels; i++) col[i] = (col[i] - low[i]) / (2 * h);
    free(low);
    return 0;
}

/* Standard error of the body's middle: texels of one probe err together, so each probe counts as one
 * measurement ((J'J)^-1 sum g g' (J'J)^-1, g = J'r of a probe; Liang and Zeger 1986).  0 where it can't be
 * told. */
static double unsure(const trial *t, const work *w)
{
    double *r = malloc((size_t)w->texels * (PARAMS + 1) * sizeof *r), sum = 0;
    double JJ[PARAMS][PARAMS] = {{0}}, g[MOST_PROBES][PARAMS] = {{0}};
    int list[PARAMS], n = 0, bad = !r;

    for (int k = 0; k < 8; k++)
        if (t->active >> k & 1) list[n++] = k;
    if (r) residuals(r, t, w);
    for (int k = 0; k < n && !bad; k++)
        bad = derivative(r + (size_t)w->texels * (size_t)(k + 1), t, w, list[k]);
    for (int k = 0; k < n && !bad; k++) {
        const double *a = r + (size_t)w->texels * (size_t)(k + 1);
        for (int m = 0; m <= k; m++) {
            const double *b = r + (size_t)w->texels * (size_t)(m + 1);
            for (int i = 0; i < w->texels; i++) JJ[k][m] += a[i] * b[i];
            JJ[m][k] = JJ[k][m];
        }
        for (int p = 0, i = 0; p < w->n; p++)
            for (int j = 0; j < w->p[p].n; j++, i++) g[p][k] += a[i] * r[i];
    }
    for (int p = 0; p < w->n && !bad; p++) {
        double a[PARAMS][PARAMS], x[PARAMS];
        memcpy(a, JJ, sizeof a);
        for (int k = 0; k < n; k++) a[k][k] *= 1 + 1e-9;
        solve(x, a, g[p], n);
        for (int k = 0; k < 3; k++) sum += x[k] * x[k];
    }
    free(r);
    return w->n > 2 ? sqrt(sum * w->n / (w->n - 1)) : 0;
}

/* A frame with the given third axis, its first along the projected covariance's larger axis. */
static void stand(trial *t, const double n[3], const double cov[3][3], double turn)
{
    double x[3], y[3], xx = 0, xy = 0, yy = 0;

    v_basis(x, y, n);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            xx += x[r] * cov[r][c] * x[c], xy += x[r] * cov[r][c] * y[c], yy += y[r] * cov[r][c] * y[c];
    const double a = .5 * atan2(2 * xy, xx - yy), mean = .5 * (xx + yy), half = hypot(.5 * (xx - yy), xy);
    v_rotate(x, n, a + turn);
    v_cross(y, n, x);
    memcpy(t->base[0], x, sizeof x), memcpy(t->base[1], y, sizeof y), memcpy(t->base[2], n, sizeof x);
    const double big = sqrt(fmax(mean + half, 1e-12)), small = sqrt(fmax(mean - half, .01 * (mean + half)));
    const double grow = t->shape == ILF_RECTANGLE ? sqrt(3) : 2;
    t->p[3] = log(grow * (t->shape == ILF_RECTANGLE ? big : sqrt(.5 * (big * big + small * small))));
    t->p[4] = log(grow * small);
    if (t->shape == ILF_RECTANGLE && fabs(turn) > .1)
        t->p[3] = t->p[4] = log(grow * sqrt(.5 * (big * big + small * small)));
}

static void tube(trial *t, const double cov[3][3])
{
    double value[3], axis[3][3];

    moments_axes(value, axis, cov);
    t->shape = ILF_TUBE, t->active = 0x1f | 1 << 5 | 1 << 7;
    memcpy(t->base, axis, sizeof axis);
    v_cross(t->base[2], t->base[0], t->base[1]);
    t->p[3] = log(fmax(1e-9, sqrt(3 * fmax(value[0], 1e-12))));
    t->p[4] = log(2 * sqrt(fmax(value[1], .01 * value[0])));
}

/* Bodies to try, the sphere first; returns their number. */
static int trials(trial *t, const double at[3], const double cov[3][3], const double towards[3], int small)
{
    const double up[3] = {0, 0, 1}, x[3] = {1, 0, 0}, y[3] = {0, 1, 0};
    const double *normal[4] = {up, x, y, towards};
    double value[3], axis[3][3];
    int n = 1;

    memset(t, 0, 16 * sizeof *t);
    moments_axes(value, axis, cov);
    stand(&t[0], up, cov, 0);
    t[0].shape = ILF_SPHERE, t[0].active = 0xf;
    t[0].p[3] = log(2 * sqrt(fmax((value[0] + value[1]) / 2, 1e-12)));
    if (!small) {
        const int square = value[1] > .75 * value[0];
        for (int k = 0; k < 4; k++)
            for (int turn = 0; turn < (square ? 2 : 1); turn++, n++) {
                t[n].shape = ILF_RECTANGLE, t[n].active = 0x3f | (k == 3 ? 3 << 6 : 0);
                stand(&t[n], normal[k], cov, turn * .785);
            }
        for (int k = 0; k < 4; k += 3, n++) {
            t[n].shape = ILF_DISC, t[n].active = 0xf | (k == 3 ? 3 << 6 : 0);
            stand(&t[n], normal[k], cov, 0);
        }
        if (value[1] < .3 * value[0]) tube(&t[n++], cov);
    }
    for (int k = 0; k < n; k++) memcpy(t[k].p, at, 3 * sizeof *at);
    return n;
}

static int by_flux(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x < y) - (x > y);
}

/* Probes that see all of the lamp: of its flux x distance^2, most.  Returns their number; which: most
 * MOST_PROBES, spread. */
static int whole(const blob **which, int *chosen, const centre *c, int number, const bloblist *l,
                 const lightfield *f)
{
    const blob **all = malloc((size_t)(l->n + 1) * sizeof *all);
    double *flux = malloc((size_t)(l->n + 1) * sizeof *flux);
    int n = 0, full = 0, wide = 0;

    for (int i = 0; all && flux && i < l->n; i++) {
        double e[3];
        if (l->b[i].lamp != number) continue;
        v_sub(e, c->at, f->pos[l->b[i].probe]);
        wide += l->b[i].reach > 3 * patch_texel(f, l->b[i].dir) ? 1 : -1;
        flux[n++] = l->b[i].flux * v_dot(e, e);
    }
    wide = wide > 0;
    *chosen = 0;
    if (n) {
        qsort(flux, (size_t)n, sizeof *flux, by_flux);
        const double least = (wide ? ALL_BUT : NEARLY) * flux[n / 20];
        for (int i = 0; i < l->n; i++) {
            double e[3];
            if (l->b[i].lamp != number) continue;
            v_sub(e, c->at, f->pos[l->b[i].probe]);
            if (l->b[i].flux * v_dot(e, e) >= least) all[full++] = &l->b[i];
        }
        for (int k = 0; k < MOST_PROBES && k < full; k++)
            which[(*chosen)++] = all[full <= MOST_PROBES ? k : (int)((long)k * full / MOST_PROBES)];
    }
    free(all), free(flux);
    return full;
}

/* How badly a body explains one probe's texels, its amplitude free: 0 to 1. */
static double own_misfit(const patch *p)
{
    double yc = 0, cc = 1e-30, yy = 1e-30;

    for (int j = 0; j < p->n; j++) {
        yc += p->sr[j] * p->lum[j] * p->cover[j], cc += p->sr[j] * p->cover[j] * p->cover[j];
        yy += p->sr[j] * p->lum[j] * p->lum[j];
    }
    return sqrt(fmax(0, 1 - yc * yc / (cc * yy)));
}

/* Keep the probes whose light agrees with the largest, once the body says how large it looks from each; 1 if
 * some went. */
static int only_whole(work *w, const trial *t)
{
    double v[MOST_PROBES], sorted[MOST_PROBES], own[MOST_PROBES];
    ilf_luminaire l;
    int kept = 0;

    body(&l, t);
    for (int i = 0; i < w->n; i++) {
        v[i] = 0;
        for (int j = 0; j < w->p[i].n; j++) v[i] += w->p[i].sr[j] * w->p[i].lum[j];
        v[i] /= ilf_luminaire_omega(&l, w->f->pos[w->p[i].probe]);
        patch_cover(&w->p[i], w->f, &l, w->S);
        sorted[i] = own[i] = own_misfit(&w->p[i]);
    }
    qsort(sorted, (size_t)w->n, sizeof *sorted, by_flux); /* largest first */
    const double good = fmax(.02, 2.5 * sorted[w->n - 1 - w->n / 4]);
    for (int i = 0; i < w->n; i++) {
        if (own[i] > good) v[i] = 0;
        sorted[i] = v[i];
    }
    qsort(sorted, (size_t)w->n, sizeof *sorted, by_flux);
    const double least = .975 * sorted[w->n > 8 ? 2 : w->n > 4 ? 1 : 0];
    double worst = 0;
    for (int i = 0; i < w->n; i++)
        if (v[i] >= least) kept++, worst = fmax(worst, own[i]);
    if (kept < (worst < SURE ? 2 : 3) || kept == w->n) return 0;
    kept = 0, w->texels = 0;
    for (int i = 0; i < w->n; i++) {
        const patch p = w->p[i];
        if (v[i] < least) {
            patch_free(&w->p[i]);
            continue;
        }
        memset(&w->p[i], 0, sizeof p);
        w->p[kept++] = p, w->texels += p.n;
    }
    w->n = kept;
    return 1;
}

static void brightest_first(work *w)
{
    double v[MOST_PROBES];

    for (int i = 0; i < w->n; i++) {
        const patch p = w->p[i];
        double sum = 0;
        int k = i;
        for (int j = 0; j < p.n; j++) sum += p.sr[j] * p.lum[j];
        for (; k > 0 && v[k - 1] < sum; k--) v[k] = v[k - 1], w->p[k] = w->p[k - 1];
        v[k] = sum, w->p[k] = p;
    }
}

/* Where few probes see all of a ball, those that see part of it spoil the fit: leave the darkest out, a
 * fourth at a time, until the rest is a ball without doubt.  1 if that helped. */
static int weed(work *w, trial *t)
{
    work few = *w;

    brightest_first(w);
    for (few.n = w->n - (w->n + 3) / 4; few.n >= 2; few.n -= (few.n + 3) / 4) {
        trial q = *t;
        few.texels = 0;
        for (int i = 0; i < few.n; i++) few.texels += w->p[i].n;
        if (fit(&q, &few)) return -1;
        if (q.misfit >= few.n * SURE * SURE) continue;
        for (int i = few.n; i < w->n; i++) patch_free(&w->p[i]);
        *w = few, *t = q;
        return 1;
    }
    return 0;
}

/* Radiance of the lamp from the probes that see all of it. */
static void radiance(shape *s, const work *w)
{
    double v[MOST_PROBES], mean = 0, var = 0, flux[3] = {0, 0, 0}, area = 0;

    for (int i = 0; i < w->n; i++) {
        const patch *p = &w->p[i];
        double sum = 0;
        patch_cover(&w->p[i], w->f, &s->l, 16);
        const double omega = ilf_luminaire_omega(&s->l, w->f->pos[p->probe]);
        for (int j = 0; j < p->n; j++) {
            const float *t = lf_texel(w->f, p->probe, p->at[j] % w->f->nt, p->at[j] / w->f->nt);
            sum += p->sr[j] * p->lum[j];
            for (int c = 0; c < 3; c++) flux[c] += p->sr[j] * ((double)t[c] - (1 - p->cover[j]) * p->ring[c]);
            area += p->sr[j] * p->cover[j];
        }
        v[i] = sum / omega + p->ring_lum;
    }
    qsort(v, (size_t)w->n, sizeof *v, by_flux);
    for (int i = 0; i < w->n; i++) mean += v[i] / w->n;
    for (int i = 0; i < w->n; i++) var += (v[i] - mean) * (v[i] - mean) / w->n;
    s->radiance = v[w->n / 2];
    s->sigma_radiance = sqrt(var / w->n) / mean;
    const double lum = .265 * flux[0] + .67 * flux[1] + .065 * flux[2];
    for (int c = 0; c < 3; c++) s->l.rgb[c] = (float)(flux[c] / lum * s->radiance);
    (void)area;
}

int shape_fit(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f, double limit)
{
    const blob *which[MOST_PROBES];
    patch patches[MOST_PROBES];
    trial t[16];
    work w = {.f = f, .p = patches};
    double cov[3][3], towards[3] = {f->len_u / 2, f->len_v / 2, 0}, cone = 0;
    int bad = 0, chosen, best = 0;

    memset(s, 0, sizeof *s);
    if (whole(which, &chosen, c, number, list, f) < 3) return 1;
    moments_covariance(cov, which, chosen, c->at, f);
    for (int i = 0; i < chosen; i++) {
        cone = fmax(cone, which[i]->reach);
        if (!bad) bad = patch_make(&patches[w.n++], f, which[i]->probe, c->at, which[i]->reach, 2, limit);
    }
    for (int i = 0; i < w.n; i++) w.texels += patches[i].n;
    v_sub(towards, towards, c->at);
    const double far = v_unit(towards), texel = patch_texel(f, which[0]->dir);
    const double wide = sqrt(fmax(0, (cov[0][0] + cov[1][1] + cov[2][2]) / 2)) * 4 / far;
    w.S = cone > 6 * texel ? 4 : cone > 3 * texel ? 6 : 10;
    w.unit = fmax(.25 * texel * far, .25 * wide * far);
    const int n = trials(t, c->at, cov, towards, wide < 1.2 * texel);
    for (int pass = 0; pass < 3 && !bad && w.texels; pass++) {
        best = 0;
        if (pass == 1 && t[0].misfit > w.n * DOUBT * DOUBT && weed(&w, &t[0]) < 0) bad = -1;
        for (int k = 0; k < n && !bad; k++) {
            bad = fit(&t[k], &w);
            if (!k && (t[0].misfit < w.n * SURE * SURE ||
                       (pass < 2 && t[0].misfit < w.n * ROUNDISH * ROUNDISH && only_whole(&w, &t[0]))))
                break;
            if (k && t[k].misfit < .81 * t[0].misfit && (!best || t[k].misfit < .98 * t[best].misfit))
                best = k;
        }
        if (t[best].misfit < w.n * SURE * SURE || (best && !only_whole(&w, &t[best]))) break;
    }
    if (!bad && w.texels) {
        (void)only_whole(&w, &t[best]);
        w.S = w.S < 8 ? 8 : 16;
        bad = fit(&t[best], &w);
        body(&s->l, &t[best]);
        s->l.far = c->far;
        s->misfit = sqrt(t[best].misfit / w.n), s->full = w.n;
        s->sigma_position = unsure(&t[best], &w);
        radiance(s, &w);
    }
    for (int i = 0; i < w.n; i++) patch_free(&patches[i]);
    return bad ? -1 : w.texels ? 0 : 1;
}

int shape_fit_ball(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f,
                   double limit)
{
    const blob *which[MOST_PROBES];
    patch patches[MOST_PROBES];
    trial t[16];
    work w = {.f = f, .p = patches, .S = 3};
    double cov[3][3], towards[3] = {f->len_u / 2, f->len_v / 2, 0};
    int bad = 0, chosen;

    memset(s, 0, sizeof *s);
    if (whole(which, &chosen, c, number, list, f) < 3) return 1;
    moments_covariance(cov, which, chosen, c->at, f);
    v_sub(towards, towards, c->at);
    const double far = v_unit(towards);
    trials(t, c->at, cov, towards, 1);
    for (int i = 0; i < chosen && !bad; i++) {
        bad = patch_make(&patches[w.n++], f, which[i]->probe, c->at, exp(t[0].p[3]) / far, 2, limit);
        w.texels += patches[i].n;
    }
    w.unit = .25 * patch_texel(f, which[0]->dir) * far;
    if (!bad && w.texels) {
        bad = fit(&t[0], &w);
        body(&s->l, &t[0]);
        s->l.far = c->far;
        s->misfit = sqrt(t[0].misfit / w.n), s->full = w.n;
        s->sigma_position = unsure(&t[0], &w);
        radiance(s, &w);
    }
    for (int i = 0; i < w.n; i++) patch_free(&patches[i]);
    return bad ? -1 : w.texels ? 0 : 1;
}

/* A trial that begins with a body. */
static void trial_of(trial *t, const ilf_luminaire *l)
{
    const int ball = l->shape == ILF_SPHERE;
    double x[3] = {1, 0, 0}, y[3] = {0, 1, 0};

    memset(t, 0, sizeof *t);
    t->shape = l->shape, t->active = ball ? 0xf : 0xff;
    memcpy(t->p, l->centre, sizeof l->centre);
    t->p[3] = log(ball ? l->radius : v_len(l->a)), t->p[4] = ball ? 0 : log(v_len(l->b));
    if (!ball) memcpy(x, l->a, sizeof x), memcpy(y, l->b, sizeof y);
    v_unit(x), v_unit(y);
    memcpy(t->base[0], x, sizeof x), memcpy(t->base[1], y, sizeof y), v_cross(t->base[2], x, y);
}

int shape_fit_lens(shape *s, const double at[3], const double cov[3][3], patch *p, int n, const lightfield *f)
{
    work w = {.f = f, .p = p, .n = n, .S = cov ? 3 : 6};
    trial t[16];
    int best = -1, many = 1, bad = 0;
    double towards[3] = {f->len_u / 2, f->len_v / 2, 0};

    for (int i = 0; i < n; i++) w.texels += p[i].n;
    v_sub(towards, towards, at);
    w.unit = .25 * v_unit(towards) * f->dp;
    if (cov) many = trials(t, at, cov, towards, 0);
    else trial_of(&t[0], &s->l);
    for (int k = 0; k < many && !bad; k++) {
        if (t[k].shape == ILF_TUBE) continue;
        bad = fit(&t[k], &w);
        if (best < 0 || t[k].misfit < .98 * t[best].misfit) best = k;
    }
    body(&s->l, &t[best]);
    s->misfit = sqrt(t[best].misfit / n), s->full = n;
    return bad;
}

/* The same body lying or standing straight, where it nearly does; 1 if it doesn't. */
static int straight(trial *t)
{
    double *n = t->base[2], *x = t->base[0];
    int k = 0;

    for (int c = 1; c < 3; c++)
        if (fabs(n[c]) > fabs(n[k])) k = c;
    if (t->shape == ILF_SPHERE || t->shape == ILF_TUBE || fabs(n[k]) < NEARLY_STRAIGHT) return 1;
    for (int c = 0; c < 3; c++) n[c] = c == k ? (n[k] < 0 ? -1 : 1) : 0;
    for (int c = 0; c < 3; c++) x[c] -= n[c] * n[k] * x[k];
    v_unit(x), v_cross(t->base[1], n, x);
    t->active = t->shape == ILF_DISC ? 0xf : 0x3f;
    return 0;
}

/* Texels of the probes that see most of the lamp. */
static int partly(work *w, const shape *s, const double *seen, double limit)
{
    const lightfield *f = w->f;
    double least = .08;
    int many;

    do {
        many = 0, least *= 1.25;
        for (int k = 0; k < f->n; k++) many += seen[k] > least;
    } while (many > MOST_PROBES && least < .8);
    for (int k = 0; k < f->n && w->n < MOST_PROBES; k++) {
        if (seen[k] <= least) continue;
        if (patch_make(&w->p[w->n], f, k, s->l.centre, ilf_luminaire_cone(&s->l, f->pos[k]), 2, limit))
            return -1;
        w->p[w->n].behind = &s->l;
        w->texels += w->p[w->n].n;
        w->n += w->p[w->n].n > 0;
    }
    return w->n < 6;
}

/* Radiance that fits all texels. */
static void shine_behind(shape *s, const work *w, const ilf_luminaire *l)
{
    double all[3] = {0, 1e-30, 0}, ring = 0;

    for (int i = 0; i < w->n; i++) {
        patch_cover(&w->p[i], w->f, l, w->S);
        products(all, &w->p[i]);
        ring += w->p[i].ring_lum / w->n;
    }
    const double lum = all[0] / all[1] + ring;
    for (int c = 0; c < 3; c++) s->l.rgb[c] *= (float)(lum / s->radiance);
    s->radiance = lum;
}

int shape_fit_behind(shape *s, const double *seen, const lightfield *f, double limit)
{
    patch patches[MOST_PROBES];
    work w = {.f = f, .p = patches, .S = 6, .together = 1};
    trial t[2];
    int bad = partly(&w, s, seen, limit), best = 0;
    double towards[3] = {f->len_u / 2, f->len_v / 2, 0};

    v_sub(towards, towards, s->l.centre);
    w.unit = fmax(.25 * v_len(towards) * f->dp, .25 * ilf_luminaire_extent(&s->l));
    trial_of(&t[0], &s->l);
    t[1] = t[0];
    const int free_only = straight(&t[1]);
    for (int k = 0; k < 2 - free_only && !bad; k++) bad = fit(&t[k], &w);
    if (!bad) {
        ilf_luminaire l;
        best = !free_only && t[1].misfit < AS_GOOD * t[0].misfit;
        body(&l, &t[best]);
        l.far = s->l.far;
        shine_behind(s, &w, &l);
        memcpy(s->l.centre, l.centre, sizeof l.centre), memcpy(s->l.a, l.a, sizeof l.a),
            memcpy(s->l.b, l.b, sizeof l.b);
        s->l.radius = l.radius, s->misfit = sqrt(t[best].misfit / w.n);
        s->sigma_position = unsure(&t[best], &w);
    }
    for (int i = 0; i < w.n; i++) patch_free(&patches[i]);
    return bad;
}
