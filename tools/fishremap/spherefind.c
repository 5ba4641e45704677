/*
 * spherefind.c - refining mirror spheres in a photograph (spherefind.h).
 *
 * A mirror sphere's rim is no clean edge: reflections of reflections crowd on its inner side, and where it
 * reflects the ground that it stands on, it hardly shows.  But outside of it there is nothing except smooth
 * ground, crossed by the edges of shadows.  So a ray that leaves the centre votes for a radius r at which the
 * picture changes, and beyond which it does not:
 *
 *      vote = log( |change at r| + QUIET ) - log( |change beyond r| + QUIET )
 *
 *      brightness  ~\/\/~\_/~~|____________     the logarithm makes a faint rim on quiet ground as good as a
 *                  reflections r   ground        strong one, and what is busy on both sides votes for nothing
 *
 * All spheres vote together: the homography and the radius that win are the array's.
 */
#include "spherefind.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RAYS 128 /* two a pixel of the smallest rims: fewer leave the votes rough */
#define CLOSEST                                                                                              \
    0.985 /* diameters between neighbours: they cannot be one in the other, but a radius may be a little     \
             wrong */
#define QUIET 0.02 /* log units: changes below are noise */
#define MOST  2.0  /* the strongest vote */

typedef struct picture {
    float *grey; /* log units */
    int w, h;
    double co[RAYS], si[RAYS]; /* the rays' directions */
} picture;

static int picture_init(picture *p, const float *pix, int w, int h)
{
    *p = (picture){.grey = circle_grey(pix, w, h), .w = w, .h = h};
    for (int k = 0; k < RAYS; k++) p->co[k] = cos(2 * M_PI * k / RAYS), p->si[k] = sin(2 * M_PI * k / RAYS);
    return p->grey ? 0 : -1;
}

static double at(const picture *p, double x, double y)
{
    x -= 0.5, y -= 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    if (i < 0 || j < 0 || i + 1 >= p->w || j + 1 >= p->h) return NAN;
    double u = x - i, v = y - j;
    const float *g = p->grey + (size_t)j * (size_t)p->w + (size_t)i;
    return (1 - v) * ((1 - u) * (double)g[0] + u * (double)g[1]) +
           v * ((1 - u) * (double)g[p->w] + u * (double)g[p->w + 1]);
}

/* Is the point clear of the spheres around node (i, j)? */
static int is_ground(const sphere_seen near[8], int n, double x, double y, double margin)
{
    for (int k = 0; k < n; k++)
        if (hypot(x - near[k].x, y - near[k].y) < near[k].r + margin) return 0;
    return 1;
}

/* Mean vote of one sphere's rays to the ground, the sphere moved by (dx, dy), and their number.  b: half the
 * width, in pixels, over which a change is seen. */
static double sphere_votes(int *rays, const sphere_grid *g, const picture *p, int sphere, double dx,
                           double dy, double b)
{
    /* from the rim, half widths; a gap, so that the edge's own blur does not count as change beyond */
    static const double from[5] = {-1, 1, 1.5, 3.5, 5.5};
    int i0 = sphere % g->n, j0 = sphere / g->n, nnear = 0, count = 0;
    sphere_seen c = sphere_grid_at(NULL, g, i0, j0), near[8];
    double sum = 0;
    for (int j = j0 - 1; j <= j0 + 1; j++)
        for (int i = i0 - 1; i <= i0 + 1; i++)
            if ((i != i0 || j != j0) && i >= 0 && j >= 0 && i < g->n && j < g->m)
                near[nnear++] = sphere_grid_at(NULL, g, i, j);
    c.x += dx, c.y += dy;
    for (int k = 0; k < RAYS; k++) {
        double v[5], far = c.r + 6 * b;
        if (!is_ground(near, nnear, c.x + far * p->co[k], c.y + far * p->si[k], b)) continue;
        for (int i = 0; i < 5; i++)
            v[i] = at(p, c.x + (c.r + from[i] * b) * p->co[k], c.y + (c.r + from[i] * b) * p->si[k]);
        double in = fabs(v[1] - v[0]), out = 0.5 * (fabs(v[3] - v[2]) + fabs(v[4] - v[3]));
        if (isnan(in) || isnan(out)) continue;
        sum += fmax(-MOST, fmin(MOST, log((in + QUIET) / (out + QUIET))));
        count++;
    }
    *rays = count;
    return count ? sum / count : 0;
}

/* The votes for a grid, times the radius: every pixel of a rim has one, so that of two circles that are seen
 * equally well the larger wins; what it has inside are reflections.  Not all spheres need be asked. */
static double all_votes(const sphere_grid *g, const picture *p, double b, int every)
{
    double sum = 0, count = 0;
    for (int k = 0; k < g->n * g->m; k += every) {
        int rays;
        double v = sphere_votes(&rays, g, p, k, 0, 0, b) * sphere_grid_at(NULL, g, k % g->n, k / g->n).r;
        sum += rays * v, count += rays;
    }
    return count > 0 ? sum / count : 0;
}

/* A grid through four corner positions, radii in proportion to the local scale with the mean kept;
 * radii for which there is no room between the corners become smaller. */
static int through_corners(sphere_grid *g, sphere_seen c[4], double rotate)
{
    sphere_seen q[4];
    double mean = 0, scale[4], sum = 0;
    for (int k = 0; k < 4; k++) mean += c[k].r / 4;
    for (int k = 0; k < 4; k++) q[k] = (sphere_seen){c[k].x, c[k].y, mean};
    sphere_grid t;
    if (sphere_grid_init(&t, g->n, g->m, q, rotate, NULL)) return -1;
    for (int k = 0; k < 4; k++) {
        double s = k == 1 || k == 2 ? g->n - 1 : 0, u = k >= 2 ? g->m - 1 : 0;
        sphere_seen o = sphere_grid_at(NULL, &t, s, u), a = sphere_grid_at(NULL, &t, s + 0.1, u),
                    b = sphere_grid_at(NULL, &t, s, u + 0.1);
        scale[k] = sqrt(fabs((a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x)));
        sum += scale[k] / 4;
    }
    for (int k = 0; k < 4; k++) t.r[k] = mean * scale[k] / sum;
    double room = sphere_grid_pitch(&t) / CLOSEST;
    for (int k = 0; k < 4 && room < 1; k++) t.r[k] *= room, c[k].r *= room;
    *g = t;
    return 0;
}

/* All corners together, within reach: place and radius, in steps of a pixel or less. */
static void place(sphere_grid *g, sphere_seen c[4], const sphere_seen given[4], double reach,
                  const picture *p, double rotate)
{
    double step = fmax(0.5, fmin(g->r[0] / 30, 1)), best = 0;
    int q = (int)(reach / step), every = g->n * g->m / 40 + 1;
    while (every > 1 && g->n % every == 0) every++; /* not the same column in every row */
    for (int r = -q; r <= q; r++)
        for (int y = -q; y <= q; y++)
            for (int x = -q; x <= q; x++) {
                sphere_seen t[4];
                sphere_grid try = *g;
                for (int k = 0; k < 4; k++)
                    t[k] = (sphere_seen){given[k].x + step * x, given[k].y + step * y, given[k].r + step * r};
                if (step * hypot(x, y) > reach || through_corners(&try, t, rotate)) continue;
                double v = all_votes(&try, p, fmax(0.75 * step, 0.5), every);
                if (v > best) best = v, *g = try, memcpy(c, t, sizeof t);
            }
}

/* Move the four corners one at a time and all together, and the radius, to where the votes are highest; no
 * corner further than reach from where it was given. */
static void climb(sphere_grid *g, sphere_seen c[4], const sphere_seen given[4], double reach,
                  const picture *p, double coarse, double rotate)
{
    for (double step = coarse; step > 0.04; step /= 2) {
        double b = fmax(0.75 * step, 0.5), best = all_votes(g, p, b, 1);
        for (int round = 0, moved = 1; moved && round < 8; round++) {
            moved = 0;
            for (int k = 0; k < 22;
                 k++) { /* 0..5: all of them in x, y and radius; then one by one in x and y */
                sphere_seen t[4];
                sphere_grid try = *g;
                int who = k < 6 ? -1 : (k - 6) / 4, what = k < 6 ? k / 2 : (k - 6) % 4 / 2, far = 0;
                for (int i = 0; i < 4; i++) {
                    t[i] = c[i];
                    if (who < 0 || who == i)
                        *(what == 0 ? &t[i].x : what == 1 ? &t[i].y : &t[i].r) += k & 1 ? step : -step;
                    far |= hypot(t[i].x - given[i].x, t[i].y - given[i].y) > reach + 1 ||
                           fabs(t[i].r - given[i].r) > reach + 1;
                }
                if (far || through_corners(&try, t, rotate)) continue;
                double q = all_votes(&try, p, b, 1);
                if (q > best) best = q, *g = try, memcpy(c, t, sizeof t), moved = 1;
            }
        }
    }
}

/* One sphere's own shift from the grid, to a twentieth of a pixel: the best of a raster within reach, then
 * uphill. */
static void own_shift(double shift[2], const sphere_grid *g, const picture *p, int sphere, double reach)
{
    double best = -INFINITY;
    int q = (int)reach, rays;
    shift[0] = shift[1] = 0;
    for (int y = -q; y <= q; y++)
        for (int x = -q; x <= q; x++) {
            double v = hypot(x, y) > reach ? -INFINITY : sphere_votes(&rays, g, p, sphere, x, y, 0.75);
            if (v > best) best = v, shift[0] = x, shift[1] = y;
        }
    for (double step = 0.5; step > 0.04; step /= 2) {
        best = -INFINITY;
        for (int k = 0, moved = 1; moved && k < 6; k++) {
            double x0 = shift[0], y0 = shift[1];
            moved = 0;
            for (int d = 0; d < 5; d++) {
                double x = x0 + (d == 1   ? step
                                 : d == 2 ? -step
                                          : 0),
                       y = y0 + (d == 3   ? step
                                 : d == 4 ? -step
                                          : 0);
                double v = sphere_votes(&rays, g, p, sphere, x, y, 0.5);
                if (v > best) best = v, shift[0] = x, shift[1] = y, moved = d > 0;
            }
        }
    }
}

/* Move the corners by what the spheres' own shifts say in common: between the corners a shift is bilinear,
 * which to first order is what a homography does; wild shifts lose their weight (Tukey). */
static void straighten(sphere_seen c[4], const sphere_grid *g, double (*shift)[2], double wild)
{
    double x[4][2] = {{0}};
    for (int it = 0; it < 10; it++) {
        double a[16] = {0}, b[4][2] = {{0}};
        for (int k = 0; k < g->n * g->m; k++) {
            double s = (double)(k % g->n) / (g->n - 1), t = (double)(k / g->n) / (g->m - 1);
            double w[4] = {(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t}, r[2];
            for (int d = 0; d < 2; d++)
                r[d] = shift[k][d] - (w[0] * x[0][d] + w[1] * x[1][d] + w[2] * x[2][d] + w[3] * x[3][d]);
            double q = hypot(r[0], r[1]) / wild, weight = q < 1 ? (1 - q * q) * (1 - q * q) : 0;
            for (int i = 0; i < 4; i++) {
                for (int j = 0; j < 4; j++) a[4 * i + j] += weight * w[i] * w[j];
                for (int d = 0; d < 2; d++) b[i][d] += weight * w[i] * shift[k][d];
            }
        }
        if (LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', 4, 2, a, 4, &b[0][0], 2)) return;
        memcpy(x, b, sizeof x);
    }
    for (int k = 0; k < 4; k++) c[k].x += x[k][0], c[k].y += x[k][1];
}

int sphere_shift_window(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate,
                        errmsg *e)
{
    picture p;
    sphere_grid g = {.n = n, .m = m};
    sphere_seen c[4], best[4];
    double mean = (corner[0].r + corner[1].r + corner[2].r + corner[3].r) / 4, b = fmax(1, 0.06 * mean),
           most = 0;
    if (picture_init(&p, pix, w, h)) return err_set(e, "out of memory");
    memcpy(c, corner, sizeof c), memcpy(best, corner, sizeof best);
    for (int k = 0; k < 9 && !through_corners(&g, c, rotate); k++) {
        static const int order[9] = {4, 0, 1, 2, 3, 5, 6, 7, 8}; /* as it is first */
        int di = order[k] % 3 - 1, dj = order[k] / 3 - 1;
        sphere_seen t[4];
        sphere_grid try = g;
        int outside = 0;
        for (int q = 0; q < 4; q++) {
            t[q] = sphere_grid_at(NULL, &g, (q == 1 || q == 2 ? n - 1 : 0) + di, (q >= 2 ? m - 1 : 0) + dj);
            t[q].r = c[q].r;
            outside |= fmin(fmin(t[q].x, t[q].y), fmin(w - t[q].x, h - t[q].y)) < t[q].r;
        }
        if ((k && outside) || through_corners(&try, t, rotate)) continue;
        double v = all_votes(&try, &p, b, 1);
        if (k == 0) most = v + 0.05 * fabs(v); /* a neighbour has to be clearly better */
        else if (v > most) most = v, memcpy(best, t, sizeof t);
    }
    memcpy(corner, best, sizeof best);
    free(p.grey);
    return 0;
}

int sphere_refine(sphere_seen *q, sphere_fit *fit, sphere_grid *g, const sphere_seen corner[4], double rotate,
                  double reach, const float *pix, int w, int h, errmsg *e)
{
    int total = g->n * g->m, rc = -1;
    picture p;
    double(*shift)[2] = malloc(sizeof *shift * (size_t)total);
    sphere_seen c[4], found[4];
    const sphere_grid given = *g;
    memset(fit, 0, sizeof *fit);
    if (picture_init(&p, pix, w, h) || !shift) {
        err_set(e, "out of memory");
        goto done;
    }
    memcpy(c, corner, sizeof c);
    double mean = (c[0].r + c[1].r + c[2].r + c[3].r) / 4;
    if (through_corners(g, c, rotate)) {
        err_set(e, "corners: expected spheres that a grid of %d x %d fits, found none", g->n, g->m);
        goto done;
    }
    place(g, c, corner, reach, &p, rotate);
    fit->votes = all_votes(g, &p, 0.5, 1) / mean;
    for (int it = 0, better = 1; better && it < 5;
         it++) { /* what the spheres say, and what fits all; the first time far around */
        sphere_grid best = *g;
        better = 0;
        for (int moved = 0; moved < 2; moved++) { /* from here, and from where the spheres' own shifts point:
                                                     shadows can mislead them */
            sphere_seen t[4];
            sphere_grid try = *g;
            memcpy(t, c, sizeof t);
            if (moved) {
                for (int k = 0; k < total; k++) own_shift(shift[k], g, &p, k, it ? 2 : reach);
                straighten(t, g, shift, it ? 1.5 : reach);
            }
            if (through_corners(&try, t, rotate)) continue;
            climb(&try, t, corner, reach, &p, it ? 0.25 : 1, rotate);
            double votes = all_votes(&try, &p, 0.5, 1) / mean;
            if (votes > fit->votes) fit->votes = votes, best = try, memcpy(found, t, sizeof t), better = 1;
        }
        if (better) *g = best, memcpy(c, found, sizeof c);
    }
    if (fit->votes < 0.1) {
        rc = 1;
        goto done;
    }
    double sq = 0;
    for (int k = 0; k < total; k++) {
        q[k] = sphere_grid_at(NULL, g, k % g->n, k / g->n);
        own_shift(shift[k], g, &p, k, 2);
        double off = hypot(shift[k][0], shift[k][1]);
        sq += off * off;
        fit->seen += off < 1;
    }
    fit->rms = sqrt(sq / total);
    rc = 0;
done:
    if (rc) *g = given;
    free(shift);
    free(p.grey);
    return rc;
}
