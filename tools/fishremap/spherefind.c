/*
 * spherefind.c - refining and finding mirror spheres (spherefind.h).
 *
 * No single mirror sphere has a clean rim: its neighbours' reflections crowd there.  All of them
 * together do: the homography that makes the picture change most across all the circles at once.
 */
#include "spherefind.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double at(const float *g, int w, int h, double x, double y)
{
    x -= 0.5, y -= 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    if (i < 0 || j < 0 || i + 1 >= w || j + 1 >= h) return NAN;
    double u = x - i, v = y - j;
    const float *p = g + (size_t)j * (size_t)w + (size_t)i;
    return (1 - v) * ((1 - u) * (double)p[0] + u * (double)p[1]) + v * ((1 - u) * (double)p[w] + u * (double)p[w + 1]);
}

/* Which rays count, and how. */
typedef struct rays {
    double baseline; /* pixels on either side of the rim */
    double most;     /* log units; a lamp's edge has no more say than a rim */
    int between;     /* only along the directions between the neighbours */
    int sphere;      /* this one only; -1: all */
    int quadrant;    /* with between: only this of the four, or -1 */
} rays;

/* Mean radial change across the circles of f times the grid's radii, moved by (dx, dy). */
static double rim_contrast(const sphere_grid *g, const float *grey, int w, int h, double f, double dx, double dy, rays how)
{
    enum { RAYS = 40 };
    double sum = 0, count = 0;
    int total = g->n * g->m;
    for (int s = how.sphere < 0 ? 0 : how.sphere; s < (how.sphere < 0 ? total : how.sphere + 1); s++) {
        double u;
        sphere_seen c = sphere_grid_at(&u, g, s % g->n, s / g->n);
        double r = c.r * f, x = c.x + dx, y = c.y + dy, b = how.baseline;
        for (int i = 0; i < RAYS; i++) {
            if (how.between && how.quadrant >= 0 && i % 4 != how.quadrant) continue;
            double a = how.between ? -u + M_PI / 4 + M_PI / 2 * (i % 4) + (i / 4 - 4.5) * 0.06 : 2 * M_PI * i / RAYS;
            double co = cos(a), si = sin(a);
            double d = at(grey, w, h, x + (r + b) * co, y + (r + b) * si) - at(grey, w, h, x + (r - b) * co, y + (r - b) * si);
            if (!isnan(d)) sum += fmin(fabs(d), how.most), count++;
        }
    }
    return count > 0 ? sum / count : 0;
}

/* The rim's radius in one of the four directions between neighbours, common to all spheres, as a factor on
 * the grid's.  A mirror sphere's rim is no clean edge: reflections of reflections crowd towards it.  But
 * outside of it they end: coming from outside, the change rises to a first crest, whose half height lies
 * half a pixel beyond the rim.  0: no such crest. */
static double common_radius(const sphere_grid *g, const float *grey, int w, int h, int quadrant, double from, double to)
{
    enum { STEPS = 120 };
    const double step = (to - from) / STEPS;
    double mean[STEPS + 1], low = INFINITY, high = 0, px = 0, crest = 0;
    for (int k = 0; k < 4; k++) px += g->r[k] / 4;
    for (int k = 0; k <= STEPS; k++) {
        double f = from + step * k;
        mean[k] = rim_contrast(g, grey, w, h, f, 0, 0, (rays){0.5, INFINITY, 1, -1, quadrant});
        if (f > from + 0.3 * (to - from) && f < to - 0.15 * (to - from)) high = fmax(high, mean[k]);
        if (f > from + 0.67 * (to - from)) low = fmin(low, mean[k]);
    }
    int k = STEPS;
    while (k > 0 && mean[k] < low + 0.2 * (high - low)) k--;
    if (k == 0 || k == STEPS || high < 1.5 * low) return 0;
    for (int i = k; i > 0 && (k - i) * step * px < 1.5; i--) crest = fmax(crest, mean[i]);
    double half = 0.5 * (crest + low);
    while (k > 0 && mean[k] < half) k--;
    return from + step * (k + (mean[k] - half) / (mean[k] - mean[k + 1])) - 0.5 / px;
}

/* Radius and shift from the rim's radii in the four directions: r(a) = r + dx cos a + dy sin a. */
static void common_rim(sphere_seen c[4], const sphere_grid *g, const float *grey, int w, int h)
{
    double u, r[4], mean = 0, sum = 0, dx = 0, dy = 0;
    sphere_grid_at(&u, g, 0.5 * (g->n - 1), 0.5 * (g->m - 1));
    for (int k = 0; k < 4; k++) mean += g->r[k] / 4;
    for (int q = 0; q < 4; q++) {
        r[q] = common_radius(g, grey, w, h, q, 0.86, 1.10);
        if (r[q] == 0) return;
        double a = -u + M_PI / 4 + M_PI / 2 * q;
        sum += r[q] / 4, dx += mean * r[q] * cos(a) / 2, dy += mean * r[q] * sin(a) / 2;
    }
    if (hypot(dx, dy) > 0.1 * mean) return;
    for (int k = 0; k < 4; k++) c[k].x += dx, c[k].y += dy, c[k].r *= sum;
}

/* A grid through four corner positions, radii in proportion to the local scale with the mean kept. */
static int through_corners(sphere_grid *g, const sphere_seen c[4], double rotate)
{
    sphere_seen q[4];
    double mean = 0, scale[4], sum = 0;
    for (int k = 0; k < 4; k++) mean += c[k].r / 4;
    for (int k = 0; k < 4; k++) q[k] = (sphere_seen){c[k].x, c[k].y, mean};
    sphere_grid t;
    if (sphere_grid_init(&t, g->n, g->m, q, rotate, NULL)) return -1;
    for (int k = 0; k < 4; k++) {
        double s = k == 1 || k == 2 ? g->n - 1 : 0, u = k >= 2 ? g->m - 1 : 0;
        sphere_seen o = sphere_grid_at(NULL, &t, s, u), a = sphere_grid_at(NULL, &t, s + 0.1, u), b = sphere_grid_at(NULL, &t, s, u + 0.1);
        scale[k] = sqrt(fabs((a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x)));
        sum += scale[k] / 4;
    }
    for (int k = 0; k < 4; k++) t.r[k] = mean * scale[k] / sum;
    *g = t;
    return 0;
}

/* Move the four corners, one at a time and all together, to where the rims show the most contrast; from
 * coarse to fine, the baseline shrinking with the step; no corner further than reach from where it was given
 * (shadows of the spheres make circles as well). */
static void climb(sphere_grid *g, sphere_seen c[4], const sphere_seen given[4], double reach, const float *grey, int w, int h,
                  double coarse, double rotate)
{
    for (double step = coarse; step > 0.06; step /= 2) {
        rays how = {fmax(step, 0.5), step > 0.5 ? 0.4 : 0.15, 0, -1, -1};
        double best = rim_contrast(g, grey, w, h, 1, 0, 0, how);
        for (int round = 0, moved = 1; moved && round < 6; round++) {
            moved = 0;
            for (int k = 0; k < 5; k++)
                for (int d = 0; d < 4; d++) {
                    sphere_seen t[4];
                    sphere_grid try = *g;
                    memcpy(t, c, sizeof t);
                    for (int i = 0; i < 4; i++)
                        if (k == 4 || k == i) t[i].x += d == 0 ? step : d == 1 ? -step : 0, t[i].y += d == 2 ? step : d == 3 ? -step : 0;
                    int far = 0;
                    for (int i = 0; i < 4; i++) far |= hypot(t[i].x - given[i].x, t[i].y - given[i].y) > reach;
                    if (far || through_corners(&try, t, rotate)) continue;
                    double q = rim_contrast(&try, grey, w, h, 1, 0, 0, how);
                    if (q > best) best = q, *g = try, memcpy(c, t, sizeof t), moved = 1;
                }
        }
    }
}

/* One sphere's own shift from the grid, to a twentieth of a pixel, within 2 pixels. */
static void own_shift(double *dx, double *dy, const sphere_grid *g, const float *grey, int w, int h, int sphere)
{
    double best = 0;
    *dx = *dy = 0;
    for (double step = 1; step > 0.04; step /= 2) {
        rays how = {fmax(step, 0.5), step > 0.3 ? 0.4 : 0.15, 0, sphere, -1};
        best = rim_contrast(g, grey, w, h, 1, *dx, *dy, how);
        for (int k = 0, moved = 1; moved && k < 4; k++) {
            moved = 0;
            for (int d = 0; d < 4; d++) {
                double x = *dx + (d == 0 ? step : d == 1 ? -step : 0), y = *dy + (d == 2 ? step : d == 3 ? -step : 0);
                double c = hypot(x, y) < 2 ? rim_contrast(g, grey, w, h, 1, x, y, how) : 0;
                if (c > best) best = c, *dx = x, *dy = y, moved = 1;
            }
        }
    }
}

/* Straighten the grid by what its spheres' own rims say: the part of their shifts that grows along u or v.
 * (Their mean is left to the common rim, which shadows don't sway.) */
static void straighten(sphere_grid *g, sphere_seen c[4], const float *grey, int w, int h, double rotate)
{
    double slope[2][2] = {{0}}, norm[2] = {0}, ms = 0.5 * (g->n - 1), mt = 0.5 * (g->m - 1);
    for (int k = 0; k < g->n * g->m; k++) {
        double d[2], st[2] = {k % g->n - ms, k / g->n - mt};
        own_shift(&d[0], &d[1], g, grey, w, h, k);
        if (hypot(d[0], d[1]) > 1.5) continue;
        for (int i = 0; i < 2; i++) {
            norm[i] += st[i] * st[i];
            for (int x = 0; x < 2; x++) slope[x][i] += d[x] * st[i];
        }
    }
    for (int k = 0; k < 4; k++) {
        double st[2] = {k == 1 || k == 2 ? ms : -ms, k >= 2 ? mt : -mt};
        for (int i = 0; i < 2; i++)
            if (norm[i] > 0) c[k].x += slope[0][i] / norm[i] * st[i], c[k].y += slope[1][i] / norm[i] * st[i];
    }
    through_corners(g, c, rotate);
}

int sphere_outer_radius(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate, errmsg *e)
{
    sphere_grid g = {.n = n, .m = m};
    float *grey = circle_grey(pix, w, h);
    if (!grey) return err_set(e, "out of memory");
    /* a tenth less than asked for, or neighbours that touch would be found to overlap by a rounding */
    for (int k = 0; k < 4; k++) corner[k].r *= 0.9;
    int rc = sphere_grid_init(&g, n, m, corner, rotate, e);
    double k = rc ? 0 : common_radius(&g, grey, w, h, -1, 0.6, 1.3);
    free(grey);
    for (int i = 0; i < 4; i++) corner[i].r *= k > 0 ? fmin(k, 1.11) : 1.1;
    return rc;
}

int sphere_refine(sphere_seen *q, sphere_fit *fit, sphere_grid *g, const sphere_seen corner[4], double rotate, double slack,
                  double reach, const float *pix, int w, int h, errmsg *e)
{
    int total = g->n * g->m, rc = -1;
    float *grey = circle_grey(pix, w, h);
    sphere_seen c[4];
    memset(fit, 0, sizeof *fit);
    if (!grey) return err_set(e, "out of memory");
    memcpy(c, corner, sizeof c);
    double mean = (c[0].r + c[1].r + c[2].r + c[3].r) / 4;
    if (through_corners(g, c, rotate)) goto done; /* a row or a column: left as it is */
    for (int it = 0; it < 3; it++) {
        climb(g, c, corner, reach, grey, w, h, it ? 0.5 : slack, rotate);
        for (int i = 0; i < 3; i++) {
            common_rim(c, g, grey, w, h);
            through_corners(g, c, rotate);
        }
    }
    for (int it = 0; it < 2; it++) straighten(g, c, grey, w, h, rotate);
    rays fine = {0.5, 0.15, 0, -1, -1};
    double here = rim_contrast(g, grey, w, h, 1, 0, 0, fine), there = 0;
    for (int k = 0; k < 8; k++) there += rim_contrast(g, grey, w, h, 1, 0.15 * mean * cos(k * M_PI / 4), 0.15 * mean * sin(k * M_PI / 4), fine) / 8;
    fit->contrast = there > 0 ? here / there : 0;
    for (int k = 0; k < 4; k++) /* a corner may be off by a good part of a radius, not by a sphere */
        if (hypot(c[k].x - corner[k].x, c[k].y - corner[k].y) > 0.6 * mean) {
            err_set(e, "corner %d: expected the sphere near %.1f,%.1f, found it at %.1f,%.1f by all the others; check the corners", k + 1, corner[k].x, corner[k].y, c[k].x, c[k].y);
            goto done;
        }
    if (fit->contrast < 1.1) {
        rc = 1;
        goto done;
    }
    double sq = 0;
    for (int k = 0; k < total; k++) {
        double dx, dy;
        q[k] = sphere_grid_at(NULL, g, k % g->n, k / g->n);
        own_shift(&dx, &dy, g, grey, w, h, k);
        double off = hypot(dx, dy);
        sq += off * off;
        fit->seen += off < 1;
    }
    fit->rms = sqrt(sq / total);
    rc = 0;
done:
    free(grey);
    return rc;
}
