/*
 * gradient.c - wide lamps whose face is not even.  A lens' radiance G depends on the direction alone, so what
 * the probes see in one direction is either G (the ray meets the lens) or dark.  All probes have the same
 * texels, so G is a picture of texels: at first the second largest of the probes' values, then, as the body
 * is known, their mean weighted by cover.  Where the lens hangs: at the height at which the rays' lit parts
 * L/G agree best.
 */
#include "gradient.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { MOST_PATCHES = 48, HEIGHTS = 36, CELLS = 128, SIDE = 61, TO_BEGIN = 14 };
#define DIM      .08 /* of the largest G: darker directions say nothing about where the lens is */
#define LIT      .5  /* L/G of a ray that meets it */
#define FAINT    .05 /* of the brightest spot: probes that see less are not asked */
#define STIFF    .1  /* weight of a texel's neighbours in G, of one texel's own */
#define EMPTY    .003
#define LOW      .05 /* d_z: rays lower than this cross no height */
#define LEAST    4.  /* texels: narrower lamps have no face that could be seen */
#define GOOD_FIT .2  /* rms misfit of a lens */

typedef struct lens {
    const lightfield *f;
    double limit;
    int n;
    patch p[MOST_PATCHES];
    double *G, *num, *den; /* per texel */
} lens;

static void lens_free(lens *g)
{
    for (int i = 0; i < g->n; i++) patch_free(&g->p[i]);
    free(g->G), free(g->num), free(g->den);
}

static int lens_make(lens *g, const lightfield *f, double limit)
{
    const size_t all = (size_t)f->nt * (size_t)f->np;

    memset(g, 0, sizeof *g);
    g->f = f, g->limit = limit;
    g->G = calloc(all, sizeof *g->G), g->num = calloc(all, sizeof *g->num),
    g->den = calloc(all, sizeof *g->den);
    return g->G && g->num && g->den ? 0 : -1;
}

/* Patches about `at` of the spots of lamp `number` that are bright enough. */
static int gather(lens *g, const double at[3], double cone, const ilf_luminaire *l, int number,
                  const bloblist *list)
{
    double top = 0;
    int many = 0;

    for (int i = 0; i < g->n; i++) patch_free(&g->p[i]);
    g->n = 0;
    for (int i = 0; i < list->n; i++)
        if (list->b[i].lamp == number) top = fmax(top, list->b[i].flux);
    for (int i = 0; i < list->n; i++) many += list->b[i].lamp == number && list->b[i].flux > FAINT * top;
    for (int i = 0, k = 0; i < list->n; i++) {
        const blob *b = &list->b[i];
        if (b->lamp != number || b->flux <= FAINT * top) continue;
        const int turn = k++;
        if (many > MOST_PATCHES && turn * MOST_PATCHES / many == k * MOST_PATCHES / many) continue;
        if (g->n == MOST_PATCHES) break;
        patch *p = &g->p[g->n];
        const double wide = l ? ilf_luminaire_cone(l, g->f->pos[b->probe]) : cone;
        if (patch_make(p, g->f, b->probe, at, wide, 2, g->limit)) return -1;
        if (p->n) g->n++;
    }
    return 0;
}

/* G's first guess: the second largest of all probes' values. */
static void second_largest(lens *g)
{
    memset(g->num, 0, (size_t)g->f->nt * (size_t)g->f->np * sizeof *g->num);
    memset(g->G, 0, (size_t)g->f->nt * (size_t)g->f->np * sizeof *g->G);
    for (int i = 0; i < g->n; i++)
        for (int j = 0; j < g->p[i].n; j++) {
            const int k = lf_common(g->f, g->p[i].probe, g->p[i].at[j]);
            const double v = g->p[i].lum[j];
            if (v > g->num[k]) g->G[k] = g->num[k], g->num[k] = v;
            else g->G[k] = fmax(g->G[k], v);
        }
}

static double largest(const double *G, const lightfield *f)
{
    double top = 0;

    for (int k = 0; k < f->nt * f->np; k++) top = fmax(top, G[k]);
    return top;
}

/* G from sums of cover x value and cover x cover; texels without either lean on their neighbours. */
static void settle(double *G, const double *num, const double *den, const lightfield *f)
{
    const int all = f->nt * f->np;

    for (int k = 0; k < all; k++) G[k] = den[k] > 0 ? num[k] / den[k] : 0;
    for (int round = 0; round < 40; round++)
        for (int q = 0; q < all; q++) {
            const int k = round & 1 ? all - 1 - q : q;
            double sum = 0, n = 0;
            for (int s = 0; s < 4; s++) {
                int x = k % f->nt, y = k / f->nt;
                if (!lf_beside(&x, &y, f, s == 0 ? 1 : s == 1 ? -1 : 0, s == 2 ? 1 : s == 3 ? -1 : 0))
                    continue;
                sum += G[y * f->nt + x], n++;
            }
            G[k] = (num[k] + STIFF * sum / n) / (den[k] + STIFF + EMPTY);
        }
}

static void covered_mean(lens *g, const ilf_luminaire *l)
{
    const size_t bytes = (size_t)g->f->nt * (size_t)g->f->np * sizeof *g->num;

    memset(g->num, 0, bytes), memset(g->den, 0, bytes);
    for (int i = 0; i < g->n; i++) {
        patch *p = &g->p[i];
        patch_cover(p, g->f, l, 6);
        for (int j = 0; j < p->n; j++) {
            const int k = lf_common(g->f, p->probe, p->at[j]);
            g->num[k] += p->cover[j] * p->lum[j], g->den[k] += p->cover[j] * p->cover[j];
        }
    }
    settle(g->G, g->num, g->den, g->f);
}

static int set_gains(lens *g)
{
    for (int i = 0; i < g->n; i++) {
        patch *p = &g->p[i];
        if (!p->gain) p->gain = malloc((size_t)p->n * sizeof *p->gain);
        if (!p->gain) return -1;
        for (int j = 0; j < p->n; j++) p->gain[j] = fmax(0, g->G[lf_common(g->f, p->probe, p->at[j])]);
    }
    return 0;
}

static void drop_gains(lens *g)
{
    for (int i = 0; i < g->n; i++) free(g->p[i].gain), g->p[i].gain = NULL;
}

/* Rays' lit parts, gathered where they cross a height. */
typedef struct crossing {
    double x0, y0, cell;
    double n[CELLS * CELLS], sum[CELLS * CELLS], square[CELLS * CELLS];
} crossing;

static void cross(crossing *c, const lens *g, double h, const double at[3], double top)
{
    const lightfield *f = g->f;
    const double k = h / at[2];

    memset(c, 0, sizeof *c);
    c->cell = 1.2 * f->dp * h / (at[2] / v_len(at)); /* about a texel's size there */
    c->x0 = f->len_u / 2 + k * (at[0] - f->len_u / 2) - c->cell * CELLS / 2;
    c->y0 = f->len_v / 2 + k * (at[1] - f->len_v / 2) - c->cell * CELLS / 2;
    for (int i = 0; i < g->n; i++)
        for (int j = 0; j < g->p[i].n; j++) {
            const int own = g->p[i].at[j], t = lf_common(f, g->p[i].probe, own);
            double d[3];
            if (g->G[t] < DIM * top) continue;
            lf_direction(d, f, g->p[i].probe, own % f->nt + .5, own / f->nt + .5);
            if (d[2] < LOW) continue;
            const double *o = f->pos[g->p[i].probe], v = fmax(0, fmin(1, g->p[i].lum[j] / g->G[t]));
            const double x = (o[0] + (h - o[2]) / d[2] * d[0] - c->x0) / c->cell,
                         y = (o[1] + (h - o[2]) / d[2] * d[1] - c->y0) / c->cell;
            if (!(x >= 0 && y >= 0 && x < CELLS && y < CELLS)) continue;
            const int q = (int)y * CELLS + (int)x;
            c->n[q]++, c->sum[q] += v, c->square[q] += v * v;
        }
}

/* Mean variance within cells that several rays cross. */
static double disagreement(const crossing *c)
{
    double sum = 0, n = 0;

    for (int k = 0; k < CELLS * CELLS; k++)
        if (c->n[k] > 1) sum += c->square[k] - c->sum[k] * c->sum[k] / c->n[k], n += c->n[k] - 1;
    return n > 0 ? sum / n : 1e30;
}

/* Middle and covariance of the cells that are lit; 1 if there are few. */
static int lit_cells(double at[3], double cov[3][3], const crossing *c, double h)
{
    double n = 0, x = 0, y = 0;

    memset(cov, 0, 9 * sizeof **cov);
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < CELLS * CELLS; k++) {
            const double u = c->x0 + c->cell * (k % CELLS + .5), v = c->y0 + c->cell * (k / CELLS + .5);
            if (c->n[k] < 2 || c->sum[k] < LIT * c->n[k]) continue;
            if (!pass) n++, x += u, y += v;
            else {
                const double p = u - x / n, q = v - y / n;
                cov[0][0] += p * p / n, cov[1][1] += q * q / n, cov[0][1] += p * q / n;
            }
        }
    if (n < 9) return 1;
    cov[1][0] = cov[0][1], cov[2][2] = 1e-3 * (cov[0][0] + cov[1][1]);
    at[0] = x / n, at[1] = y / n, at[2] = h;
    return 0;
}

/* Where it hangs; c: where its spots' middles meet. */
static int place(double at[3], double cov[3][3], const lens *g, const centre *c)
{
    crossing *x = malloc(sizeof *x);
    const double top = largest(g->G, g->f);
    double best = 1e30, height = 0;
    int r;

    if (!x) return -1;
    for (int k = 0; k < HEIGHTS; k++) {
        const double h = c->at[2] * pow(1.04, k - .75 * HEIGHTS);
        cross(x, g, h, c->at, top);
        const double miss = disagreement(x);
        if (miss < best) best = miss, height = h;
    }
    cross(x, g, height, c->at, top);
    r = lit_cells(at, cov, x, height);
    free(x);
    return r;
}

/* Colour and radiance from G's largest; 1 if no probe sees it. */
static int shine(shape *s, const lens *g)
{
    double flux[3] = {0, 0, 0};

    s->radiance = largest(g->G, g->f), s->sigma_radiance = s->misfit / sqrt(g->n);
    for (int i = 0; i < g->n; i++)
        for (int j = 0; j < g->p[i].n; j++) {
            const patch *p = &g->p[i];
            const float *t = lf_texel(g->f, p->probe, p->at[j] % g->f->nt, p->at[j] / g->f->nt);
            if (p->cover[j] < .9) continue;
            for (int c = 0; c < 3; c++) flux[c] += p->sr[j] * ((double)t[c] - p->ring[c]);
        }
    const double lum = .265 * flux[0] + .67 * flux[1] + .065 * flux[2];
    for (int c = 0; c < 3; c++) s->l.rgb[c] = (float)(flux[c] / lum * s->radiance);
    return !(lum > 0);
}

/* A body from nothing: all kinds are tried, on some of the patches. */
static int begin(shape *s, const lens *g, const double at[3], const double cov[3][3])
{
    patch few[TO_BEGIN];
    const int n = g->n < TO_BEGIN ? g->n : TO_BEGIN;

    for (int i = 0; i < n; i++) few[i] = g->p[i * g->n / n]; /* borrowed */
    return shape_fit_lens(s, at, cov, few, n, g->f);
}

/* Body and G in turns. */
static int in_turns(shape *s, lens *g, const centre *c, int number, const bloblist *list)
{
    double at[3], cov[3][3];
    int r = place(at, cov, g, c);

    if (r) return r;
    if (set_gains(g) || begin(s, g, at, cov)) return -1;
    for (int turn = 0; turn < 3; turn++) {
        memcpy(at, s->l.centre, sizeof at);
        if (!(at[2] > 0)) return 1;
        if (gather(g, at, 0, &s->l, number, list)) return -1;
        if (g->n < 3) return 1;
        drop_gains(g);
        covered_mean(g, &s->l);
        if (turn < 2 && (set_gains(g) || shape_fit_lens(s, at, NULL, g->p, g->n, g->f))) return -1;
    }
    s->lens = 1;
    return shine(s, g) || !(s->misfit <= GOOD_FIT);
}

int gradient_fit(shape *s, const centre *c, int number, const bloblist *list, const lightfield *f,
                 double limit)
{
    shape mine = {.misfit = 1};
    double reach = 0;
    lens g;
    int r = 1;

    if (c->far || c->at[2] <= 0) return 1;
    for (int i = 0; i < list->n; i++)
        if (list->b[i].lamp == number) reach = fmax(reach, list->b[i].reach);
    if (2 * reach < LEAST * f->dp) return 1;
    if (lens_make(&g, f, limit) || gather(&g, c->at, 1.4 * reach, NULL, number, list)) r = -1;
    else if (g.n >= 6) {
        second_largest(&g);
        r = in_turns(&mine, &g, c, number, list);
    }
    if (!r) *s = mine;
    lens_free(&g);
    return r;
}

/* Sums over the probes that take part in a fold: what the texels passed of the lamp's radiance. */
static int passed(lens *g, double *seen, const lamp *l, int fold)
{
    const lightfield *f = g->f;
    const size_t all = (size_t)f->nt * (size_t)f->np;
    int i = 0;

    memset(g->num, 0, all * sizeof *g->num), memset(g->den, 0, all * sizeof *g->den);
    for (int k = 0; k < f->n; k++) {
        patch p;
        memset(seen, 0, all * sizeof *seen);
        for (; i < l->nfilled && l->filled[i] / all == (size_t)k; i++) {
            const int t = (int)(l->filled[i] % all);
            const double now = lf_lum(f, k, t % f->nt, t / f->nt);
            seen[t] = (ilf_luminance(l->was + 4 * i) - now) / fmax(l->s.radiance - now, 1e-30);
        }
        if (fold_of(f, k) == fold) continue;
        if (patch_make(&p, f, k, l->s.l.centre, ilf_luminaire_cone(&l->s.l, f->pos[k]), 1.5, g->limit))
            return -1;
        patch_cover(&p, f, &l->s.l, 6);
        for (int j = 0; j < p.n; j++) {
            const int t = lf_common(f, k, p.at[j]);
            g->num[t] += p.cover[j] * seen[p.at[j]], g->den[t] += p.cover[j] * p.cover[j];
        }
        patch_free(&p);
    }
    settle(g->G, g->num, g->den, f);
    return 0;
}

/* G at a direction, bilinear between texels. */
static double look(const double *G, const lightfield *f, const double d[3])
{
    double x, y, sum = 0;

    lf_place(&x, &y, f, LF_FIELD, d);
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;
    for (int k = 0; k < 4; k++) {
        int i = (int)fx, j = (int)fy;
        if (lf_beside(&i, &j, f, k & 1, k >> 1))
            sum += (k & 1 ? a : 1 - a) * (k & 2 ? b : 1 - b) * G[j * f->nt + i];
    }
    return sum;
}

/* The tangents that covered texels span. */
static void span(double lo[2], double hi[2], const double *den, const lightfield *f)
{
    for (int a = 0; a < 2; a++) lo[a] = 1e30, hi[a] = -1e30;
    for (int k = 0; k < f->nt * f->np; k++) {
        double d[3];
        if (den[k] <= .2) continue;
        lf_direction(d, f, LF_FIELD, k % f->nt + .5, k / f->nt + .5);
        for (int a = 0; a < 2 && d[2] >= LOW; a++)
            lo[a] = fmin(lo[a], d[a] / d[2] - f->dp), hi[a] = fmax(hi[a], d[a] / d[2] + f->dp);
    }
}

static int picture(ilf_mask *m, const lens *g, const double c[3])
{
    double lo[2], hi[2];

    span(lo, hi, g->den, g->f);
    if (lo[0] > hi[0]) return 1;
    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_FOOT, m->link = ILF_LINK_VALUE, m->beta = -1;
    if (mask_grid(m, SIDE, SIDE, c[0] - c[2] * hi[0], c[1] - c[2] * hi[1], c[0] - c[2] * lo[0],
                  c[1] - c[2] * lo[1]))
        return -1;
    for (int k = 0; k < SIDE * SIDE; k++) {
        double d[3] = {(c[0] - m->x0 - k % SIDE * m->dx) / c[2], (c[1] - m->y0 - k / SIDE * m->dy) / c[2], 1};
        v_unit(d);
        m->grid[k] = (float)fmax(0, look(g->G, g->f, d));
    }
    return 0;
}

int gradient_mask(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    lens g;
    double *seen = malloc((size_t)f->nt * (size_t)f->np * sizeof *seen);
    int bad = lens_make(&g, f, 1e30) || !seen ? -1 : 0;

    (void)pics;
    if (!bad && !l->s.lens) bad = 1;
    for (int fold = 0; fold <= FOLDS && !bad; fold++) {
        bad = passed(&g, seen, l, fold);
        if (!bad) bad = picture(&m->m[fold][m->n], &g, l->s.l.centre);
    }
    lens_free(&g), free(seen);
    if (bad) return bad;
    m->n++;
    model_judge(m, l, f);
    m->blind = model_spread(m, l, f);
    return 0;
}
