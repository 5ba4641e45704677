/*
 * stack.c - twigs and leaves: where nearly all probes see something dark, something is (a silhouette hull:
 * Laurentini 1994), in sheets one above the other between the plane and the lamp.  A place's opacity is the
 * 1.5 % quantile over the probes of what their pictures show there; how opaque is opaque is told by the
 * lamp's rows.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "layers.h"
#include "vec.h"

enum { COARSE = 72, COARSE_SHEETS = 24, FINE = 208, SHEETS = 36, MOST_SHEETS = 108, KEPT = 16 };
#define ABOVE    .45
#define QUANTILE .015
#define PARTING  1.5 /* cells */
#define CLEAR    .2  /* an opacity below this is none */

typedef struct job {
    const lamp *l;
    const lightfield *f;
    const pictures *pics;
    int n, *order; /* probes asked, in an order that spreads them */
} job;

/* The KEPT smallest values of each fold's others. */
typedef struct least {
    float v[FOLDS + 1][KEPT];
    int n[FOLDS + 1], seen[FOLDS + 1];
} least;

static void insert(least *l, int fold, float x, int room)
{
    float *v = l->v[fold];
    int k = l->n[fold];

    l->seen[fold]++;
    if (k == room && x >= v[k - 1]) return;
    if (k < room) l->n[fold]++;
    else k--;
    for (; k > 0 && v[k - 1] > x; k--) v[k] = v[k - 1];
    v[k] = x;
}

static int rank_of(int n)
{
    const int r = (int)(QUANTILE * n + .5);

    return r < KEPT - 1 ? r : KEPT - 1;
}

/* Opacity at a place, without each fold and with all; 1 if it may be anything but clear. */
static int occupied(float o[FOLDS + 1], const job *j, const double x[3])
{
    const int full = rank_of(j->n), less = rank_of(j->n * (FOLDS - 1) / FOLDS);
    least l;
    int clear = 0;

    memset(l.n, 0, sizeof l.n), memset(l.seen, 0, sizeof l.seen);
    for (int k = 0; k < j->n; k++) {
        const int q = j->order[k], fold = fold_of(j->f, q);
        double e[3], px, py;
        v_sub(e, x, j->f->pos[q]);
        if (e[2] < .2 * v_len(e)) continue;
        lf_place(&px, &py, j->f, q, e);
        const float v = (float)pictures_look(j->pics, q, px, py);
        if (v < 0) continue;
        clear += v < CLEAR;
        if (clear > full + FOLDS + 2) return 0; /* whichever fold is left out */
        for (int s = 0; s <= FOLDS; s++)
            if (s != fold) insert(&l, s, v, (s == ALL ? full : less) + 1);
    }
    int any = 0;
    for (int s = 0; s <= FOLDS; s++) {
        o[s] = l.seen[s] >= 6 ? l.v[s][rank_of(l.seen[s]) < l.n[s] ? rank_of(l.seen[s]) : l.n[s] - 1] : 0;
        any |= o[s] > CLEAR;
    }
    return any;
}

static double height_of(double h0, double h1, int k, int n)
{
    const double t = n > 1 ? (double)k / (n - 1) : 0;

    return 1 / ((1 - t) / h0 + t / h1);
}

/* Fill the stack's pictures of all five versions. */
static void fill(ilf_mask *m[FOLDS + 1], const job *j)
{
    const ilf_mask *a = m[ALL];
    const double *c = j->l->s.l.centre;

#pragma omp parallel for schedule(dynamic, 8)
    for (int line = 0; line < a->nz * a->ny; line++) {
        const double h = height_of(a->plane[0], a->plane[1], line / a->ny, a->nz), t = h / c[2];
        for (int i = 0; i < a->nx; i++) {
            const double p[2] = {a->x0 + i * a->dx, a->y0 + line % a->ny * a->dy};
            const double x[3] = {(1 - t) * p[0] + t * c[0], (1 - t) * p[1] + t * c[1], h};
            float o[FOLDS + 1];
            if (!occupied(o, j, x)) continue;
            for (int s = 0; s <= FOLDS; s++)
                if (m[s]) m[s]->grid[(size_t)line * (size_t)a->nx + (size_t)i] = o[s];
        }
    }
}

static int stack_grid(ilf_mask *m, int side, int sheets, double h0, double h1, const lightfield *f)
{
    const double edge = ABOVE * f->size;

    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_STACK;
    m->plane[0] = h0, m->plane[1] = h1;
    if (mask_grid(m, side, side * sheets, -edge, 0, f->len_u + edge, 1)) return -1;
    m->ny = side, m->nz = sheets, m->y0 = -edge, m->dy = (f->len_v + 2 * edge) / (side - 1);
    return 0;
}

/* Heights between which things are, from a coarse look; 0 if there are none. */
static int heights(double *h0, double *h1, const job *j)
{
    ilf_mask coarse, *only[FOLDS + 1] = {NULL, NULL, NULL, NULL, &coarse};
    const double low = .05 * lamp_ceiling(j->l, j->f), high = .8 * lamp_ceiling(j->l, j->f);
    double most = 0, weight[COARSE_SHEETS];
    int first = -1, last = -1;

    if (stack_grid(&coarse, COARSE, COARSE_SHEETS, low, high, j->f)) return -1;
    fill(only, j);
    for (int k = 0; k < COARSE_SHEETS; k++) {
        weight[k] = 0;
        for (int i = 0; i < COARSE * COARSE; i++) weight[k] += coarse.grid[k * COARSE * COARSE + i] > .5f;
        most = fmax(most, weight[k]);
    }
    for (int k = 0; k < COARSE_SHEETS; k++)
        if (weight[k] > .15 * most) first = first < 0 ? k : first, last = k;
    free(coarse.grid);
    if (most < 8) return 0;
    *h0 = height_of(low, high, first > 0 ? first - 1 : 0, COARSE_SHEETS);
    *h1 = height_of(low, high, last + 1 < COARSE_SHEETS ? last + 1 : last, COARSE_SHEETS);
    return 1;
}

/* The largest opacity that each row's samples meet. */
static void opacities(double *o, ilf_mask *m, const job *j)
{
    m->coef[0] = 0, m->coef[1] = 1;
    for (int k = 0; k < j->l->nrows; k++)
        for (int q = 0; q < j->l->rows[k].n; q++) {
            const double p =
                ilf_mask_pass(m, j->l->s.l.centre, j->f->pos[j->l->rows[k].probe], j->l->rows[k].dir[q]);
            o[k * ROW_SAMPLES + q] = log((1 - p) / p);
        }
}

/* Threshold and softness that fit the rows of probes that are not of the fold. */
static void calibrate(ilf_mask *m, double *o, const double *base, int fold, const job *j)
{
    double best = 1e30, at = .5, soft = .1;

    opacities(o, m, j);
    for (int s = 0; s < 4; s++)
        for (int t = 1; t < 20; t++) {
            const double thr = .05 * t, width = .02 * pow(2, s);
            double sum = 0;
            for (int k = 0; k < j->l->nrows; k++) {
                const row *r = &j->l->rows[k];
                double v = 0;
                if (fold_of(j->f, r->probe) == fold) continue;
                for (int q = 0; q < r->n; q++)
                    v += base[k * ROW_SAMPLES + q] / (1 + exp((o[k * ROW_SAMPLES + q] - thr) / width));
                sum += r->share * (v / r->n - r->value) * (v / r->n - r->value);
            }
            if (sum < best) best = sum, at = thr, soft = width;
        }
    m->coef[0] = at, m->coef[1] = soft;
}

static void base_pass(double *base, const model *m, int fold, const job *j)
{
    ilf_luminaire b = j->l->s.l;

    b.nmasks = m->n, b.masks = (ilf_mask *)m->m[fold];
    for (int k = 0; k < j->l->nrows; k++)
        for (int q = 0; q < j->l->rows[k].n; q++)
            base[k * ROW_SAMPLES + q] =
                ilf_luminaire_pass(&b, j->f->pos[j->l->rows[k].probe], j->l->rows[k].dir[q]);
}

/* A few sheets, unless lines from one to the next part by so many cells. */
static int sheets_for(int wanted)
{
    if (wanted > PARTING * SHEETS) return wanted > MOST_SHEETS ? MOST_SHEETS : wanted;
    return wanted < 4 ? 4 : wanted > SHEETS ? SHEETS : wanted;
}

static int build(model *m, const job *j, double h0, double h1)
{
    const double cell = (j->f->len_u + 2 * ABOVE * j->f->size) / (FINE - 1);
    /* from one sheet to the next, lines from probes .6 sizes apart part by a cell */
    const int wanted = (int)ceil(.6 * j->f->size * log(h1 / h0) / cell);
    const int sheets = sheets_for(wanted);
    ilf_mask *all[FOLDS + 1];
    double *o = malloc((size_t)j->l->nrows * ROW_SAMPLES * 2 * sizeof *o),
           *base = o + (size_t)j->l->nrows * ROW_SAMPLES;

    if (!o) return -1;
    for (int s = 0; s <= FOLDS; s++) {
        all[s] = &m->m[s][m->n];
        if (stack_grid(all[s], FINE, sheets, h0, h1, j->f)) return free(o), -1;
    }
    fill(all, j);
    for (int s = 0; s <= FOLDS; s++) base_pass(base, m, s, j), calibrate(all[s], o, base, s, j);
    free(o);
    m->n++, m->saw = 1, m->height = 2 / (1 / h0 + 1 / h1);
    model_judge(m, j->l, j->f);
    return 0;
}

enum { MOST_ASKED = 200 };

int layers_stack(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    const int step = (f->n + MOST_ASKED - 1) / MOST_ASKED;
    job j = {l, f, pics, 0, malloc((size_t)f->n * sizeof *j.order)};
    double h0, h1;

    if (!j.order) return -1;
    for (int k = 0; k < f->n; k += step) j.order[j.n++] = k;
    for (int k = j.n - 1, seed = 12345; k > 0; k--) { /* a fixed shuffle */
        seed = (int)((1103515245u * (unsigned)seed + 12345u) & 0x7fffffff);
        const int q = seed / 65536 % (k + 1), t = j.order[k];
        j.order[k] = j.order[q], j.order[q] = t;
    }
    int r = heights(&h0, &h1, &j);
    r = r < 0 ? -1 : r == 0 ? 1 : build(m, &j, h0, h1);
    free(j.order);
    return r;
}
