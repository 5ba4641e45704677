/*
 * interpolation.c - what the probes measured of a lamp, between them: bilinear in a grid, else means weighted by
 * distance.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "smooth.h"

/* Probes' means of rows, less what the masks so far say. */
static void measured(double *v, const model *m, int fold, const lamp *l, const lightfield *f, int adds)
{
    for (int k = 0; k < f->n; k++) v[k] = adds ? 0 : fmax(0, l->seen[k]);
    if (!adds) return;
    for (int k = 0; k < l->nrows; k++) {
        const row *r = &l->rows[k];
        v[r->probe] += r->share * (r->value - model_row(r, l, f, m->m[fold], m->n));
    }
}

/* Where probes stand freely the mask is so fine. */
enum { FINE = 33 };

/* Mean of the probes that take part, by the fourth power of their nearness. */
static double between(const double *v, const lightfield *f, int fold, double x, double y)
{
    double sum = 0, all = 1e-300;

    for (int k = 0; k < f->n; k++) {
        const double a = f->pos[k][0] - x, b = f->pos[k][1] - y, r = a * a + b * b,
                     w = 1 / (r * r + 1e-12 * pow(f->size, 4));
        if (fold_of(f, k) != fold) sum += w * v[k], all += w;
    }
    return sum / all;
}

static void fill_free(ilf_mask *m, const double *v, const lightfield *f, int fold)
{
    for (int k = 0; k < FINE * FINE; k++)
        m->grid[k] = (float)between(v, f, fold, m->x0 + k % FINE * m->dx, m->y0 + k / FINE * m->dy);
}

/* Probes that were left out get their neighbours' mean. */
static double neighbours(const double *v, const lightfield *f, int i, int j)
{
    static const int step[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    double sum = 0;
    int n = 0;

    for (int k = 0; k < 4; k++) {
        const int x = i + step[k][0], y = j + step[k][1];
        if (x < 0 || y < 0 || x >= f->nu || y >= f->nv) continue;
        sum += v[y * f->nu + x], n++;
    }
    return n ? sum / n : 0;
}

static void fill_grid(ilf_mask *m, const double *v, const lightfield *f, int fold)
{
    for (int p = 0; p < f->n; p++)
        m->grid[p] = (float)(fold_of(f, p) == fold ? neighbours(v, f, p % f->nu, p / f->nu) : v[p]);
}

int smooth_interpolation(model *m, const lamp *l, const lightfield *f, int adds)
{
    double *v = malloc((size_t)f->n * sizeof *v);
    int bad = v ? 0 : -1;

    for (int fold = 0; fold <= FOLDS && !bad; fold++) {
        ilf_mask *k = &m->m[fold][m->n];
        memset(k, 0, sizeof *k);
        k->kind = ILF_MASK_FOOT, k->link = ILF_LINK_VALUE, k->adds = adds;
        const int wide = f->nu > 1 || f->free, high = f->nv > 1 || f->free;
        bad = mask_grid(k, f->free ? FINE : f->nu, f->free ? FINE : f->nv, wide ? 0 : f->len_u / 2,
                        high ? 0 : f->len_v / 2, f->len_u, f->len_v);
        if (bad) break;
        measured(v, m, fold, l, f, adds);
        f->free ? fill_free(k, v, f, fold) : fill_grid(k, v, f, fold);
    }
    free(v);
    if (bad) return -1;
    m->n++;
    model_judge(m, l, f);
    return 0;
}
