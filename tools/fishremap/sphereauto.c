/*
 * sphereauto.c - finding a mirror-sphere array without a hint (spherefind.h).
 *
 * The picture repeats itself, sphere by sphere: the steps of the lattice are the shifts, along the picture's
 * right and up, at which its gradient correlates best with itself.  What is unlike among neighbouring cells
 * tells where in its cell a sphere stands.  The middle of a sphere shows the distant room, as its neighbour's
 * does; the ground between them, sharp shadows included, repeats exactly; only the ring around the middle,
 * where spheres mirror each other's mirror images, differs:
 *
 *          . ground and shadows: alike .
 *              ,-~~~~~~~-.
 *            /  .-------.  \   <- the ring between INNER r and r: unlike
 *           |  |  room:  |  |
 *           |  |  alike  |  |
 *
 * Which nodes are spheres is seen from how alike their middles are: the n x m window that holds most likeness
 * is the array.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "spherefind.h"

#define SIDE 480 /* pixels, longer side of the working copy */
#define CELL 32  /* places tried across the repeating cell */
#define INNER                                                                                                \
    0.68 /* of the radius: outside of it a sphere shows its neighbours (0.64 where they touch, sphere.h) */

typedef struct work {
    int w, h;
    double k; /* pixels of the picture per pixel here */
    float *g, *gx, *gy;
} work;

static void work_free(work *a)
{
    free(a->g);
    free(a->gx);
    free(a->gy);
}

static int work_init(work *a, const float *pix, int w, int h)
{
    float *full = circle_grey(pix, w, h);
    int longer = w > h ? w : h, k = (longer + SIDE - 1) / SIDE;
    memset(a, 0, sizeof *a);
    a->k = k, a->w = w / k, a->h = h / k;
    size_t n = (size_t)a->w * (size_t)a->h;
    a->g = malloc(n * sizeof(float)), a->gx = calloc(n, sizeof(float)), a->gy = calloc(n, sizeof(float));
    if (!full || !a->g || !a->gx || !a->gy) {
        free(full);
        return -1;
    }
    for (int y = 0; y < a->h; y++)
        for (int x = 0; x < a->w; x++) {
            float s = 0;
            for (int j = 0; j < k; j++)
                for (int i = 0; i < k; i++) s += full[(size_t)(y * k + j) * (size_t)w + (size_t)(x * k + i)];
            a->g[(size_t)y * (size_t)a->w + (size_t)x] = s / (float)(k * k);
        }
    free(full);
    for (int y = 1; y + 1 < a->h; y++)
        for (int x = 1; x + 1 < a->w; x++) {
            size_t at = (size_t)y * (size_t)a->w + (size_t)x;
            a->gx[at] = fmaxf(-0.5f, fminf(0.5f, (a->g[at + 1] - a->g[at - 1]) / 2));
            a->gy[at] = fmaxf(-0.5f, fminf(0.5f, (a->g[at + (size_t)a->w] - a->g[at - (size_t)a->w]) / 2));
        }
    return 0;
}

/* Normalised correlation of the gradient with itself, shifted by whole pixels. */
static double likeness(const work *a, int dx, int dy)
{
    double cross = 0, one = 1e-9, two = 1e-9;
    int x0 = dx < 0 ? -dx : 0, x1 = dx > 0 ? a->w - dx : a->w, y0 = dy < 0 ? -dy : 0,
        y1 = dy > 0 ? a->h - dy : a->h;
    for (int y = y0; y < y1; y++) {
        const float *px = a->gx + (size_t)y * (size_t)a->w, *py = a->gy + (size_t)y * (size_t)a->w;
        const float *qx = a->gx + (size_t)(y + dy) * (size_t)a->w + dx,
                    *qy = a->gy + (size_t)(y + dy) * (size_t)a->w + dx;
        float c = 0, p = 0, q = 0;
        for (int x = x0; x < x1; x++) {
            c += px[x] * qx[x] + py[x] * qy[x];
            p += px[x] * px[x] + py[x] * py[x];
            q += qx[x] * qx[x] + qy[x] * qy[x];
        }
        cross += (double)c, one += (double)p, two += (double)q;
    }
    return cross / sqrt(one * two);
}

/* The shortest good shift within 12 degrees of the unit vector d, of length lo..hi; then made precise on
 * multiples. */
static double find_step(double step[2], const work *a, const double d[2], double lo, double hi, int count)
{
    double best = 0;
    for (int pass = 0; pass < 2; pass++) {
        double shortest = INFINITY;
        for (int dy = -(int)hi; dy <= (int)hi; dy++)
            for (int dx = -(int)hi; dx <= (int)hi; dx++) {
                double len = hypot(dx, dy), along = dx * d[0] + dy * d[1];
                if (len < lo || len > hi || along < 0.978 * len) continue;
                if (pass && len >= shortest) continue;
                double c = likeness(a, dx, dy);
                if (!pass && c > best) best = c, step[0] = dx, step[1] = dy;
                /* a peak that is nearly as good and clearly shorter: the first was a multiple */
                if (pass && c > 0.85 * best && len < 0.7 * hypot(step[0], step[1]))
                    shortest = len, step[0] = dx, step[1] = dy;
            }
    }
    for (int q = 2; q <= count - 1 && q <= 6; q++) {
        int mx = (int)lrint(q * step[0]), my = (int)lrint(q * step[1]), bx = mx, by = my;
        double top = -1;
        for (int j = -2; j <= 2; j++)
            for (int i = -2; i <= 2; i++) {
                if (abs(mx + i) >= a->w - 2 || abs(my + j) >= a->h - 2) continue;
                double c = likeness(a, mx + i, my + j);
                if (c > top) top = c, bx = mx + i, by = my + j;
            }
        if (top > 0.3 * best) step[0] = (double)bx / q, step[1] = (double)by / q;
    }
    return best;
}

/* A lattice of cells laid over the working copy, and the part of it that may hold the array. */
typedef struct lattice {
    double o[2], u[2], v[2]; /* corner of cell (0, 0), and the steps */
    int along_u, along_v;    /* is there more than one sphere that way? */
    int i0, j0, i1, j1;      /* cells that count: i0 <= i < i1, j0 <= j < j1 */
} lattice;

/* How unlike the same place of neighbouring cells looks: the mean difference of log grey, up to 1. */
static void fold_cells(float unlike[CELL * CELL], const work *a, const lattice *l)
{
    for (int q = 0; q < CELL; q++)
        for (int p = 0; p < CELL; p++) {
            double sum = 0, count = 0;
            for (int j = l->j0; j < l->j1; j++)
                for (int i = l->i0; i < l->i1; i++) {
                    double s = i + (p + 0.5) / CELL, t = j + (q + 0.5) / CELL;
                    double x = l->o[0] + s * l->u[0] + t * l->v[0], y = l->o[1] + s * l->u[1] + t * l->v[1];
                    if (x < 0 || y < 0 || x >= a->w || y >= a->h) continue;
                    float here = a->g[(size_t)y * (size_t)a->w + (size_t)x];
                    for (int d = 0; d < 2; d++) {
                        double nx = x + (d ? l->v[0] : l->u[0]), ny = y + (d ? l->v[1] : l->u[1]);
                        if (!(d ? l->along_v && j + 1 < l->j1 : l->along_u && i + 1 < l->i1)) continue;
                        if (nx < 0 || ny < 0 || nx >= a->w || ny >= a->h) continue;
                        sum += fmin(fabs((double)(a->g[(size_t)ny * (size_t)a->w + (size_t)nx] - here)), 1),
                            count++;
                    }
                }
            unlike[q * CELL + p] = (float)(count > 0 ? sum / count : 0);
        }
}

/* The ring of one sphere in its cell, centred on cell (0, 0)'s corner and repeated: 1 between INNER r and r,
 * with mean 0 and norm 1. */
static void ring_template(float ring[CELL * CELL], const lattice *l, double r)
{
    enum { SUB = 3 };
    double mean = 0, norm = 0;
    for (int q = 0; q < CELL; q++)
        for (int p = 0; p < CELL; p++) {
            int in = 0;
            for (int k = 0; k < SUB * SUB; k++) {
                double s = (p + (k % SUB - 1.) / SUB) / CELL, t = (q + (k / SUB - 1.) / SUB) / CELL;
                s -= nearbyint(s), t -= nearbyint(t);
                double d = hypot(s * l->u[0] + t * l->v[0], s * l->u[1] + t * l->v[1]);
                in += d < r && d > INNER * r;
            }
            ring[q * CELL + p] = (float)in / (SUB * SUB);
            mean += (double)ring[q * CELL + p] / (CELL * CELL);
        }
    for (int k = 0; k < CELL * CELL; k++) ring[k] -= (float)mean, norm += (double)(ring[k] * ring[k]);
    for (int k = 0; k < CELL * CELL; k++) ring[k] /= (float)sqrt(norm);
}

/* The sphere in the cell, moving the lattice's corner to its centre: its radius (pixels), and how well
 * (correlation, 0..1) what is unlike among neighbours fits in a ring. */
static double find_ring(double *radius, lattice *l, const work *a)
{
    float unlike[CELL * CELL], ring[CELL * CELL];
    double pitch = fmin(hypot(l->u[0], l->u[1]), hypot(l->v[0], l->v[1])), mean = 0, norm = 0, best = 0,
           at[2] = {0, 0};
    fold_cells(unlike, a, l);
    for (int k = 0; k < CELL * CELL; k++) mean += (double)unlike[k] / (CELL * CELL);
    for (int k = 0; k < CELL * CELL; k++) unlike[k] -= (float)mean, norm += (double)(unlike[k] * unlike[k]);
    for (double f = 0.25; f < 0.505; f += 0.01) {
        ring_template(ring, l, f * pitch);
        for (int q = 0; q < CELL; q++)
            for (int p = 0; p < CELL; p++) {
                float c = 0;
                for (int j = 0; j < CELL; j++)
                    for (int i = 0; i < CELL; i++)
                        c += ring[j * CELL + i] * unlike[(j + q) % CELL * CELL + (i + p) % CELL];
                if ((double)c > best)
                    best = (double)c, *radius = f * pitch, at[0] = (p + 0.5) / CELL, at[1] = (q + 0.5) / CELL;
            }
    }
    for (int x = 0; x < 2; x++) l->o[x] += at[0] * l->u[x] + at[1] * l->v[x];
    return norm > 0 ? best / sqrt(norm) : 0;
}

/* How alike the reflections around two points are: correlation of grey within 0.6 r; -1 outside. */
static double patches_alike(const work *a, double x0, double y0, double x1, double y1, double r)
{
    double n = 0, s0 = 0, s1 = 0, s00 = 0, s11 = 0, s01 = 0;
    int b = (int)(0.6 * r);
    for (int j = -b; j <= b; j++)
        for (int i = -b; i <= b; i++) {
            int xa = (int)floor(x0) + i, ya = (int)floor(y0) + j, xb = (int)floor(x1) + i,
                yb = (int)floor(y1) + j;
            if (i * i + j * j > b * b) continue;
            if (xa < 0 || ya < 0 || xb < 0 || yb < 0 || xa >= a->w || xb >= a->w || ya >= a->h || yb >= a->h)
                return -1;
            double p = (double)a->g[(size_t)ya * (size_t)a->w + (size_t)xa],
                   q = (double)a->g[(size_t)yb * (size_t)a->w + (size_t)xb];
            n++, s0 += p, s1 += q, s00 += p * p, s11 += q * q, s01 += p * q;
        }
    double v0 = s00 - s0 * s0 / n, v1 = s11 - s1 * s1 / n;
    return (s01 - s0 * s1 / n) / sqrt((v0 + 1e-3 * n) * (v1 + 1e-3 * n));
}

/* Node of the array's (0, 0): the window of n x m nodes that holds most likeness. */
static double best_window(int at[2], const work *a, const double o[2], const double u[2], const double v[2],
                          double r, int n, int m)
{
    enum { MOST = 160 };
    int half = MOST / 2,
        reach = (int)fmin(half - 1, 1.5 * hypot(a->w, a->h) / fmin(hypot(u[0], u[1]), hypot(v[0], v[1])));
    float(*like)[MOST] = calloc(MOST, sizeof *like);
    double best = -INFINITY;
    if (!like) return best;
    for (int j = -reach; j < reach; j++)
        for (int i = -reach; i < reach; i++) {
            double x = o[0] + i * u[0] + j * v[0], y = o[1] + i * u[1] + j * v[1], c = 0;
            float *l = &like[j + half][i + half];
            if (x < 0 || y < 0 || x >= a->w || y >= a->h) {
                *l = -1;
                continue;
            }
            /* with the nearest neighbours on either side, the better of the two, in both directions */
            if (n > 1)
                c += fmax(patches_alike(a, x, y, x + u[0], y + u[1], r),
                          patches_alike(a, x, y, x - u[0], y - u[1], r));
            if (m > 1)
                c += fmax(patches_alike(a, x, y, x + v[0], y + v[1], r),
                          patches_alike(a, x, y, x - v[0], y - v[1], r));
            *l = (float)(c / ((n > 1) + (m > 1)) - 0.3);
        }
    for (int j = -reach; j + m <= reach; j++)
        for (int i = -reach; i + n <= reach; i++) {
            double s = 0;
            for (int q = 0; q < m; q++)
                for (int p = 0; p < n; p++) s += (double)like[j + q + half][i + p + half];
            if (s > best) best = s, at[0] = i, at[1] = j;
        }
    free(like);
    return best / ((double)n * m);
}

static int find_array(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate,
                      errmsg *e)
{
    work a;
    /* +u in the picture: right, turned back by rotate; +v to its left */
    double co = cos(rotate), si = sin(rotate), du[2] = {co, si}, dv[2] = {si, -co}, u[2] = {0, 0},
           v[2] = {0, 0};
    if (n > 100 || m > 100)
        return err_set(e, "expected at most 100 x 100 spheres to find, found %d x %d", n, m);
    if (w / n < 12 || h / m < 12 || work_init(&a, pix, w, h))
        return err_set(e,
                       "expected at least 12 pixels a sphere, found a picture of %d x %d for %d x %d spheres",
                       w, h, n, m);
    double along_u = (fabs(co) * a.w + fabs(si) * a.h) / n, along_v = (fabs(si) * a.w + fabs(co) * a.h) / m;
    double most = n > 1 && m > 1 ? fmin(along_u, along_v) : n > 1 ? along_u : along_v, found = 1;
    if (n > 1) found = fmin(found, find_step(u, &a, du, 0.3 * most, 1.15 * most, n));
    if (m > 1) found = fmin(found, find_step(v, &a, dv, 0.3 * most, 1.15 * most, m));
    if (n == 1) u[0] = -v[1], u[1] = v[0];
    if (m == 1) v[0] = u[1], v[1] = -u[0];
    double pu = hypot(u[0], u[1]), pv = hypot(v[0], v[1]), pitch = fmin(pu, pv);
    if (found < 0.1 || fabs(pu - pv) > 0.25 * pitch) {
        work_free(&a);
        return err_set(e,
                       "expected an array of %d x %d mirror spheres, found nothing that repeats itself so; "
                       "give --corners",
                       n, m);
    }
    int reach = (int)(hypot(a.w, a.h) / pitch) + 2;
    lattice l = {{0, 0}, {u[0], u[1]}, {v[0], v[1]}, n > 1, m > 1, -reach, -reach, reach, reach};
    double radius = 0, best = 0;
    for (int pass = 0; pass < 3; pass++) { /* all that is in the picture; then the array's own cells */
        int node[2] = {0, 0};
        best = find_ring(&radius, &l, &a);
        if (!(best > 0.2) || !(best_window(node, &a, l.o, u, v, radius, n, m) > 0)) {
            best = 0;
            break;
        }
        for (int x = 0; x < 2; x++) l.o[x] += (node[0] - 0.5) * u[x] + (node[1] - 0.5) * v[x];
        l.i0 = l.j0 = 0, l.i1 = n, l.j1 = m;
    }
    for (int q = 0; q < 4; q++) {
        double i = 0.5 + (q == 1 || q == 2 ? n - 1 : 0), j = 0.5 + (q >= 2 ? m - 1 : 0);
        corner[q] = (sphere_seen){a.k * (l.o[0] + i * u[0] + j * v[0]), a.k * (l.o[1] + i * u[1] + j * v[1]),
                                  a.k * radius};
    }
    work_free(&a);
    if (!(best > 0))
        return err_set(
            e, "expected an array of %d x %d mirror spheres, found none that look alike; give --corners", n,
            m);
    return n > 1 && m > 1 ? sphere_shift_window(corner, pix, w, h, n, m, rotate, e) : 0;
}

int sphere_find_corners(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate,
                        errmsg *e)
{
    if (n > 1 || m > 1) return find_array(corner, pix, w, h, n, m, rotate, e);
    circle_found f;
    if (circle_find(&f, pix, w, h, CIRCLE_BALL, 0, e)) return -1;
    for (int k = 0; k < 4; k++) corner[k] = (sphere_seen){f.x, f.y, f.r};
    return 0;
}
