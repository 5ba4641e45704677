/*
 * spherefind.c - refining and finding mirror spheres (spherefind.h).
 *
 * Rims first: the edges of all spheres of an array vote for centres at one common radius (radial
 * symmetry); the votes' peaks hang together as a lattice, whose best n x m window is the array.
 * Then every rim on its own, and one homography through their centres.
 */
#include "spherefind.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *v, int n)
{
    qsort(v, (size_t)n, sizeof *v, by_value);
    return n % 2 ? v[n / 2] : 0.5 * (v[n / 2 - 1] + v[n / 2]);
}

/* One node of the grid and its sphere, for the fits. */
typedef struct node {
    double s, t, wt;
    sphere_seen q;
} node;

/* Homography by least squares in pixels (direct linear transform, weighted); grid coordinates are few, so
 * the equations are balanced by centring the pixels. */
static int fit_homography(double h[9], const node *p, int n, double scale)
{
    double *a = calloc((size_t)n * 2 * 8, sizeof *a), *b = calloc((size_t)n * 2 > 8 ? (size_t)n * 2 : 8, sizeof *b);
    double mx = 0, my = 0, sw = 0;
    int rc = a && b ? 0 : -1;
    for (int i = 0; i < n; i++) mx += p[i].wt * p[i].q.x, my += p[i].wt * p[i].q.y, sw += p[i].wt;
    mx /= sw, my /= sw;
    for (int i = 0; !rc && i < n; i++) {
        double x = (p[i].q.x - mx) / scale, y = (p[i].q.y - my) / scale, w = sqrt(p[i].wt);
        double rx[8] = {p[i].s, p[i].t, 1, 0, 0, 0, -x * p[i].s, -x * p[i].t};
        double ry[8] = {0, 0, 0, p[i].s, p[i].t, 1, -y * p[i].s, -y * p[i].t};
        for (int k = 0; k < 8; k++) a[(size_t)(2 * i) * 8 + (size_t)k] = w * rx[k], a[(size_t)(2 * i + 1) * 8 + (size_t)k] = w * ry[k];
        b[2 * i] = w * x, b[2 * i + 1] = w * y;
    }
    if (!rc && LAPACKE_dgels(LAPACK_ROW_MAJOR, 'N', 2 * n, 8, 1, a, 8, b, 1)) rc = -1;
    if (!rc) {
        double u[9] = {b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], 1};
        for (int k = 0; k < 3; k++) {
            h[k] = scale * u[k] + mx * u[6 + k];
            h[3 + k] = scale * u[3 + k] + my * u[6 + k];
            h[6 + k] = u[6 + k];
        }
    }
    free(a);
    free(b);
    return rc;
}

/* Radii at the grid's corners from a plane through the radii seen. */
static int fit_radii(sphere_grid *g, const node *p, int n)
{
    double *a = malloc(sizeof(double) * 3 * (size_t)n), *b = malloc(sizeof(double) * (size_t)(n > 3 ? n : 3));
    int rc = a && b ? 0 : -1;
    for (int i = 0; !rc && i < n; i++) {
        double w = sqrt(p[i].wt);
        a[3 * i] = w, a[3 * i + 1] = w * p[i].s, a[3 * i + 2] = w * p[i].t, b[i] = w * p[i].q.r;
    }
    if (!rc && LAPACKE_dgels(LAPACK_ROW_MAJOR, 'N', n, 3, 1, a, 3, b, 1)) rc = -1;
    for (int k = 0; !rc && k < 4; k++)
        g->r[k] = b[0] + (k == 1 || k == 2 ? b[1] * (g->n - 1) : 0) + (k >= 2 ? b[2] * (g->m - 1) : 0);
    free(a);
    free(b);
    return rc;
}

/* Reweighted fit of homography and radii to the nodes seen; weights go to 0 for what disagrees. */
static int fit_grid(sphere_grid *g, node *p, int n, double *rms)
{
    double *dev = malloc(sizeof *dev * (size_t)n), *copy = malloc(sizeof *copy * (size_t)n);
    int rc = dev && copy ? 0 : -1;
    double mean_r = 0, used = 0, sq = 0;
    for (int i = 0; i < n; i++) mean_r += p[i].q.r / n;
    for (int it = 0; !rc && it < 12; it++) {
        if (g->n > 1 && g->m > 1) rc = fit_homography(g->h, p, n, mean_r * (g->n + g->m));
        for (int i = 0; i < n; i++) {
            sphere_seen q = sphere_grid_at(NULL, g, p[i].s, p[i].t);
            dev[i] = hypot(p[i].q.x - q.x, p[i].q.y - q.y);
        }
        memcpy(copy, dev, sizeof *dev * (size_t)n);
        double limit = fmax(4 * median(copy, n), 0.3);
        sq = used = 0;
        for (int i = 0; i < n; i++) {
            double u = dev[i] / limit;
            p[i].wt = u < 1 ? (1 - u * u) * (1 - u * u) + 1e-6 : 1e-6;
            if (u < 1) sq += dev[i] * dev[i], used++;
        }
    }
    if (!rc && g->n > 1 && g->m > 1) rc = fit_radii(g, p, n);
    *rms = used > 0 ? sqrt(sq / used) : 0;
    free(dev);
    free(copy);
    return rc;
}

static double at(const float *g, int w, int h, double x, double y)
{
    x -= 0.5, y -= 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    if (i < 0 || j < 0 || i + 1 >= w || j + 1 >= h) return NAN;
    double u = x - i, v = y - j;
    const float *p = g + (size_t)j * (size_t)w + (size_t)i;
    return (1 - v) * ((1 - u) * (double)p[0] + u * (double)p[1]) + v * ((1 - u) * (double)p[w] + u * (double)p[w + 1]);
}

/* The radius common to all spheres, as a factor on the grid's.  A mirror sphere's rim is no clean
 * edge: reflections of reflections crowd towards it.  But outside of it they end: the mean
 * radial change over 1 px, of all spheres along the directions between their neighbours, falls
 * from its last peak to the background's level half a pixel beyond the rim. */
static double common_radius(const sphere_grid *g, const float *grey, int w, int h)
{
    enum { STEPS = 120, RAYS = 40 };
    const double from = 0.86, to = 1.10;
    double mean[STEPS + 1], px = 0;
    for (int k = 0; k <= STEPS; k++) {
        double sum = 0, count = 0;
        for (int s = 0; s < g->n * g->m; s++) {
            double u;
            sphere_seen c = sphere_grid_at(&u, g, s % g->n, s / g->n);
            double r = c.r * (from + (to - from) * k / STEPS);
            px += c.r / (g->n * g->m * (STEPS + 1.0));
            for (int i = 0; i < RAYS; i++) {
                double a = -u + M_PI / 4 + M_PI / 2 * (i % 4) + (i / 4 - 4.5) * 0.06;
                double d = at(grey, w, h, c.x + (r + 0.5) * cos(a), c.y + (r + 0.5) * sin(a)) -
                           at(grey, w, h, c.x + (r - 0.5) * cos(a), c.y + (r - 0.5) * sin(a));
                if (!isnan(d)) sum += fabs(d), count++;
            }
        }
        mean[k] = count > 0 ? sum / count : 0;
    }
    int top = 0;
    double low = INFINITY;
    for (int k = 0; k <= STEPS; k++) {
        double f = from + (to - from) * k / STEPS;
        if (f > 0.93 && f < 1.06 && mean[k] > mean[top]) top = k;
        if (f > 1.02) low = fmin(low, mean[k]);
    }
    double half = 0.5 * (mean[top] + low);
    for (int k = STEPS - 1; k >= top && mean[top] > 1.5 * low; k--)
        if (mean[k] >= half && mean[k + 1] < half) {
            double at_k = k + (mean[k] - half) / (mean[k] - mean[k + 1]);
            return from + (to - from) * at_k / STEPS - 0.5 / px;
        }
    return 1;
}

int sphere_refine(sphere_seen *q, sphere_fit *fit, sphere_grid *g, const float *pix, int w, int h, errmsg *e)
{
    int total = g->n * g->m, seen = 0, rc = -1;
    node *p = malloc(sizeof *p * (size_t)total);
    float *grey = circle_grey(pix, w, h);
    memset(fit, 0, sizeof *fit);
    if (!p || !grey) {
        err_set(e, "out of memory");
        goto done;
    }
    for (int round = 0; round < 2; round++) {
        seen = 0;
        for (int k = 0; k < total; k++) {
            sphere_seen c = sphere_grid_at(NULL, g, k % g->n, k / g->n);
            circle_found f = {c.x, c.y, c.r, 0, 0};
            double slack = round ? fmax(2, 0.04 * c.r) : fmax(3.5, 0.1 * c.r);
            if (circle_refine(&f, grey, w, h, CIRCLE_BALL, slack) || f.share < 0.3) continue;
            p[seen++] = (node){k % g->n, k / g->n, 1, {f.x, f.y, f.r}};
        }
        if (seen < (total + 1) / 2 || (total > 1 && seen < 4 && total >= 4)) {
            rc = 1;
            goto done;
        }
        sphere_grid was = *g;
        if (fit_grid(g, p, seen, &fit->rms)) {
            err_set(e, "the grid of spheres can't be fitted");
            goto done;
        }
        for (int k = 0; k < 4; k++) { /* a corner may be off by a good part of a radius, not by a sphere */
            double s = k == 1 || k == 2 ? g->n - 1 : 0, t = k >= 2 ? g->m - 1 : 0;
            sphere_seen a = sphere_grid_at(NULL, &was, s, t), b = sphere_grid_at(NULL, g, s, t);
            if (hypot(a.x - b.x, a.y - b.y) > 0.6 * a.r) {
                err_set(e, "corner (%g,%g): expected the sphere near %.1f,%.1f, found it at %.1f,%.1f by all the others; check the corners", s, t, a.x, a.y, b.x, b.y);
                goto done;
            }
        }
    }
    for (int it = 0; it < 2; it++) {
        double k = common_radius(g, grey, w, h);
        for (int c = 0; c < 4; c++) g->r[c] *= k;
    }
    for (int k = 0; k < total; k++) q[k] = sphere_grid_at(NULL, g, k % g->n, k / g->n);
    for (int i = 0; i < seen; i++) {
        sphere_seen *c = q + (int)p[i].s + (int)p[i].t * g->n;
        double off = hypot(c->x - p[i].q.x, c->y - p[i].q.y);
        if (off < fmax(4 * fit->rms, 0.5)) {
            fit->refined++;
        } else if (off < 0.1 * c->r && fabs(c->r - p[i].q.r) < 0.03 * c->r) {
            c->x = p[i].q.x, c->y = p[i].q.y; /* mounted askew: its rim says so clearly */
            fit->refined++;
        }
    }
    rc = 0;
done:
    free(p);
    free(grey);
    return rc;
}
