/*
 * process.c - a smooth mask from few measurements: Gaussian process regression in its dual.  A row measures
 * the mean of the mask (times what other masks let through) over its samples' foot coordinates; covariance
 * Matern 5/2 and a constant; left-out probes' residuals in closed form, r_B = (K^-1_BB)^-1 (K^-1 y)_B
 * (Rasmussen and Williams 2006, section 5.4.2, for blocks).
 */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "smooth.h"
#include "vec.h"

enum { USED = 4, MOST_ROWS = 420, SIDE = 49 };

typedef struct point {
    double p[2], q[2], w; /* foot: p + beta q */
} point;
typedef struct gp {
    int n, *probe;
    double *y, *noise;
    point (*at)[USED];
} gp;

static double matern(double r2, double length)
{
    const double s = sqrt(5 * r2) / length;

    return (1 + s + s * s / 3) * exp(-s);
}

static void gp_free(gp *g)
{
    free(g->probe), free(g->y), free(g->noise), free(g->at);
}

static int gp_make(gp *g, const lamp *l)
{
    const size_t n = (size_t)l->nrows + 1;

    g->n = 0;
    g->probe = malloc(n * sizeof *g->probe), g->y = malloc(n * sizeof *g->y),
    g->noise = malloc(n * sizeof *g->noise);
    g->at = malloc(n * sizeof *g->at);
    return g->probe && g->y && g->noise && g->at ? 0 : -1;
}

/* Rows of the probes that take part (fold ALL: every one), thinned where there are too many. */
static void gp_rows(gp *g, const model *m, int fold, const lamp *l, const lightfield *f)
{
    const int thin = l->nrows / MOST_ROWS + 1;

    g->n = 0;
    for (int k = 0; k < l->nrows; k++) {
        const row *r = &l->rows[k];
        if (fold_of(f, r->probe) == fold || (thin > 1 && (r->probe * 7 + k) % thin)) continue;
        for (int q = 0; q < USED; q++) {
            const double *d = r->dir[q * r->n / USED], *o = f->pos[r->probe], *c = l->s.l.centre;
            point *x = &g->at[g->n][q];
            ilf_luminaire base = l->s.l;
            base.nmasks = m->n, base.masks = (ilf_mask *)m->m[fold];
            x->w = ilf_luminaire_pass(&base, o, d) / USED;
            for (int a = 0; a < 2; a++)
                x->p[a] = o[a] - o[2] / d[2] * d[a], x->q[a] = o[a] + (c[2] - o[2]) / d[2] * d[a] - c[a];
        }
        g->probe[g->n] = r->probe, g->y[g->n] = r->value;
        g->noise[g->n] = .02 * .02 + .004 * .004 / (r->share * r->share);
        for (int q = 0; q < USED; q++) g->y[g->n] -= g->at[g->n][q].w; /* about a mask of 1 */
        g->n++;
    }
}

static double covariance(const point *a, const point *b, double beta, double length)
{
    double sum = 0;

    for (int i = 0; i < USED; i++)
        for (int j = 0; j < USED; j++) {
            const double x = a[i].p[0] - b[j].p[0] + beta * (a[i].q[0] - b[j].q[0]);
            const double y = a[i].p[1] - b[j].p[1] + beta * (a[i].q[1] - b[j].q[1]);
            sum += a[i].w * b[j].w * (matern(x * x + y * y, length) + 4);
        }
    return sum;
}

/* K's inverse (both triangles), or -1. */
static int invert(double *K, const gp *g, double beta, double length)
{
    const int n = g->n;

#pragma omp parallel for schedule(dynamic, 8)
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++)
            K[(size_t)i * (size_t)n + (size_t)j] =
                covariance(g->at[i], g->at[j], beta, length) + (i == j ? g->noise[i] : 0);
    if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', n, K, n) || LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'L', n, K, n))
        return -1;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            K[(size_t)i * (size_t)n + (size_t)j] = K[(size_t)j * (size_t)n + (size_t)i];
    return 0;
}

static void multiply(double *a, const double *K, const double *y, int n)
{
    for (int i = 0; i < n; i++) {
        a[i] = 0;
        for (int j = 0; j < n; j++) a[i] += K[(size_t)i * (size_t)n + (size_t)j] * y[j];
    }
}

/* Mean square of left-out probes' residuals. */
static double left_out(const gp *g, const double *K, const double *a)
{
    double sum = 0, block[32 * 32], x[32];
    int piv[32];

    for (int i = 0, m; i < g->n; i += m) {
        for (m = 1; i + m < g->n && m < 32 && g->probe[i + m] == g->probe[i]; m++);
        for (int r = 0; r < m; r++) {
            for (int c = 0; c < m; c++)
                block[r * m + c] = K[(size_t)(i + r) * (size_t)g->n + (size_t)(i + c)];
            x[r] = a[i + r];
        }
        if (LAPACKE_dgesv(LAPACK_ROW_MAJOR, m, 1, block, m, piv, x, 1)) return 1e30;
        for (int r = 0; r < m; r++) sum += x[r] * x[r];
    }
    return sum / g->n;
}

static double try_pair(const gp *g, double *K, double *a, double beta, double length)
{
    if (invert(K, g, beta, length)) return 1e30;
    multiply(a, K, g->y, g->n);
    return left_out(g, K, a);
}

/* The posterior mean over foot coordinates. */
static int picture(ilf_mask *m, const gp *g, const double *a, double beta, double length, const lightfield *f,
                   double wide)
{
    const double edge = .4 * f->size + fabs(beta) * wide;

    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_FOOT, m->link = ILF_LINK_VALUE, m->beta = beta;
    if (mask_grid(m, SIDE, SIDE, -edge, -edge, f->len_u + edge, f->len_v + edge)) return -1;
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double x = m->x0 + k % SIDE * m->dx, y = m->y0 + k / SIDE * m->dy;
        double sum = 1;
        for (int i = 0; i < g->n; i++)
            for (int q = 0; q < USED; q++) {
                const point *p = &g->at[i][q];
                const double u = p->p[0] + beta * p->q[0] - x, v = p->p[1] + beta * p->q[1] - y;
                sum += a[i] * p->w * (matern(u * u + v * v, length) + 4);
            }
        m->grid[k] = (float)sum;
    }
    return 0;
}

/* beta and length of least left-out error. */
static void choose(double *beta, double *length, const gp *g, double *K, double *a, double size, double unit)
{
    static const double steps[] = {-1.6, -1, -.6, -.3, 0, .4, .9, 1.6, 3, 8}, lengths[] = {.2, 1, 2};
    double grid[10];
    double best = 1e30, e[10];
    int k = 0;

    for (int i = 0; i < 10; i++) grid[i] = unit * steps[i];
    *length = .5 * size;
    for (int i = 0; i < 10; i++)
        if ((e[i] = try_pair(g, K, a, grid[i], *length)) < best) best = e[i], k = i;
    *beta = grid[k];
    double lo = grid[k ? k - 1 : 0], hi = grid[k < 9 ? k + 1 : 9];
    for (int halving = 0; halving < 2; halving++) {
        const double mid[2] = {.5 * (lo + *beta), .5 * (*beta + hi)}, here = *beta;
        for (int s = 0; s < 2; s++) {
            const double v = try_pair(g, K, a, mid[s], *length);
            if (v < best) best = v, *beta = mid[s];
        }
        if (*beta == mid[0]) hi = here;
        else if (*beta == mid[1]) lo = here;
        else lo = mid[0], hi = mid[1];
    }
    const double first = *length;
    for (int i = 0; i < 3; i++) {
        const double v = try_pair(g, K, a, *beta, lengths[i] * size);
        if (v < best) best = v, *length = lengths[i] * size;
    }
    (void)first;
}

int smooth_process(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    const double wide = l->width * v_len(l->s.l.centre) / 2;
    double beta = 0, length = 1;
    gp g = {0};
    int bad = gp_make(&g, l);
    double *K = malloc((size_t)l->nrows * (size_t)l->nrows * sizeof *K),
           *a = malloc((size_t)(l->nrows + 1) * sizeof *a);

    (void)pics;
    if (!K || !a) bad = -1;
    if (!bad) gp_rows(&g, m, ALL, l, f), choose(&beta, &length, &g, K, a, f->size, lamp_beta(l, f));
    for (int fold = 0; fold <= FOLDS && !bad; fold++) {
        gp_rows(&g, m, fold, l, f);
        if (try_pair(&g, K, a, beta, length) >= 1e30) bad = 1;
        else bad = picture(&m->m[fold][m->n], &g, a, beta, length, f, wide);
    }
    gp_free(&g), free(K), free(a);
    if (bad) return bad;
    m->n++;
    model_judge(m, l, f);
    return 0;
}
