/*
 * sphereauto.c - finding a mirror-sphere array without a hint (spherefind.h).
 *
 * Edge pixels vote, along their gradient and at both sides, for centres at radius r: a rim votes for its
 * centre with all of its length.  The r whose n*m highest peaks are highest wins.  Peaks that are
 * one step apart, along the picture's right and up, get grid indices; the n x m window of indices
 * that holds the most votes is the array.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "spherefind.h"

#define SIDE 1200 /* pixels, longer side of the working copy */

typedef struct edge {
    float x, y, dx, dy, w; /* position, unit gradient, weight */
} edge;

typedef struct peak {
    double x, y, votes;
    int i, j, known;
} peak;

typedef struct work {
    int w, h, k; /* size, pixels of the picture per pixel here */
    float *grey, *votes, *smooth;
    edge *edges;
    size_t nedges;
} work;

static void work_free(work *a)
{
    free(a->grey);
    free(a->votes);
    free(a->smooth);
    free(a->edges);
}

static int by_weight(const void *a, const void *b)
{
    float x = ((const edge *)a)->w, y = ((const edge *)b)->w;
    return (x < y) - (x > y);
}

static int work_init(work *a, const float *pix, int w, int h)
{
    float *full = circle_grey(pix, w, h);
    memset(a, 0, sizeof *a);
    int longer = w > h ? w : h;
    a->k = (longer + SIDE - 1) / SIDE;
    a->w = w / a->k, a->h = h / a->k;
    size_t n = (size_t)a->w * (size_t)a->h;
    a->grey = malloc(n * sizeof(float)), a->votes = malloc(n * sizeof(float)), a->smooth = malloc(n * sizeof(float));
    a->edges = malloc(n * sizeof(edge));
    if (!full || !a->grey || !a->votes || !a->smooth || !a->edges) {
        free(full);
        return -1;
    }
    for (int y = 0; y < a->h; y++)
        for (int x = 0; x < a->w; x++) {
            float s = 0;
            for (int j = 0; j < a->k; j++)
                for (int i = 0; i < a->k; i++) s += full[(size_t)(y * a->k + j) * (size_t)w + (size_t)(x * a->k + i)];
            a->grey[(size_t)y * (size_t)a->w + (size_t)x] = s / (float)(a->k * a->k);
        }
    free(full);
    for (int y = 1; y + 1 < a->h; y++)
        for (int x = 1; x + 1 < a->w; x++) {
            const float *p = a->grey + (size_t)y * (size_t)a->w + (size_t)x;
            int s = a->w;
            float gx = (p[-s + 1] + 2 * p[1] + p[s + 1]) - (p[-s - 1] + 2 * p[-1] + p[s - 1]);
            float gy = (p[s - 1] + 2 * p[s] + p[s + 1]) - (p[-s - 1] + 2 * p[-s] + p[-s + 1]);
            float m = hypotf(gx, gy);
            if (m > 0.1f) a->edges[a->nedges++] = (edge){(float)x, (float)y, gx / m, gy / m, m};
        }
    qsort(a->edges, a->nedges, sizeof(edge), by_weight);
    if (a->nedges > n / 4) a->nedges = n / 4;
    return a->nedges ? 0 : -1;
}

static void vote(work *a, float r)
{
    size_t n = (size_t)a->w * (size_t)a->h;
    memset(a->votes, 0, n * sizeof(float));
    for (size_t i = 0; i < a->nedges; i++) {
        const edge *e = a->edges + i;
        for (int side = -1; side <= 1; side += 2) {
            int x = (int)lrintf(e->x + (float)side * r * e->dx), y = (int)lrintf(e->y + (float)side * r * e->dy);
            if (x >= 0 && y >= 0 && x < a->w && y < a->h) a->votes[(size_t)y * (size_t)a->w + (size_t)x] += fminf(e->w, 1);
        }
    }
    memset(a->smooth, 0, n * sizeof(float));
    for (int y = 1; y + 1 < a->h; y++)
        for (int x = 1; x + 1 < a->w; x++) {
            const float *p = a->votes + (size_t)y * (size_t)a->w + (size_t)x;
            int s = a->w;
            a->smooth[(size_t)y * (size_t)s + (size_t)x] =
                p[-s - 1] + p[-s] + p[-s + 1] + p[-1] + p[0] + p[1] + p[s - 1] + p[s] + p[s + 1];
        }
}

static int by_votes(const void *a, const void *b)
{
    double x = ((const peak *)a)->votes, y = ((const peak *)b)->votes;
    return (x < y) - (x > y);
}

/* The highest peaks that are at least 1.5 r apart; their number. */
static int peaks(peak *out, int max, peak *room, const work *a, double r)
{
    int n = 0, found = 0, b = (int)fmax(1, 0.3 * r);
    for (int y = 1; y + 1 < a->h; y++)
        for (int x = 1; x + 1 < a->w; x++) {
            const float *p = a->smooth + (size_t)y * (size_t)a->w + (size_t)x;
            if (*p <= 0) continue;
            int top = 1;
            for (int j = -b; top && j <= b; j++)
                for (int i = -b; top && i <= b; i++)
                    if (x + i >= 0 && y + j >= 0 && x + i < a->w && y + j < a->h && (p[j * a->w + i] > *p || (p[j * a->w + i] == *p && (j < 0 || (j == 0 && i < 0)))))
                        top = 0;
            if (top) room[n++] = (peak){x + 0.5, y + 0.5, (double)*p, 0, 0, 0};
        }
    qsort(room, (size_t)n, sizeof *room, by_votes);
    for (int k = 0; k < n && found < max; k++) {
        int clear = 1;
        for (int i = 0; clear && i < found; i++) clear = hypot(out[i].x - room[k].x, out[i].y - room[k].y) > 1.5 * r;
        if (clear) out[found++] = room[k];
    }
    return found;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median step from a peak to its next neighbour within 40 degrees of (dx, dy); 0 if there is none. */
static int median_step(double step[2], const peak *p, int n, double dx, double dy, double r)
{
    double *sx = malloc(sizeof(double) * 2 * (size_t)n), *sy = sx ? sx + n : NULL;
    int k = 0;
    if (!sx) return 0;
    for (int i = 0; i < n; i++) {
        double best = 4.5 * r, bx = 0, by = 0;
        for (int j = 0; j < n; j++) {
            double x = p[j].x - p[i].x, y = p[j].y - p[i].y, d = hypot(x, y);
            if (j != i && d < best && x * dx + y * dy > 0.77 * d) best = d, bx = x, by = y;
        }
        if (best < 4.5 * r) sx[k] = bx, sy[k++] = by;
    }
    if (k) {
        qsort(sx, (size_t)k, sizeof *sx, by_value);
        qsort(sy, (size_t)k, sizeof *sy, by_value);
        step[0] = sx[k / 2], step[1] = sy[k / 2];
    }
    free(sx);
    return k > 0;
}

/* Give indices to all peaks that hang together with peak 0. */
static void index_peaks(peak *p, int n, const double u[2], const double v[2])
{
    double tol = 0.3 * fmin(hypot(u[0], u[1]), hypot(v[0], v[1]));
    p[0].known = 1;
    for (int grew = 1; grew;) {
        grew = 0;
        for (int a = 0; a < n; a++) {
            if (!p[a].known) continue;
            for (int d = 0; d < 4; d++) {
                int di = d == 0 ? 1 : d == 1 ? -1 : 0, dj = d == 2 ? 1 : d == 3 ? -1 : 0;
                double x = p[a].x + di * u[0] + dj * v[0], y = p[a].y + di * u[1] + dj * v[1];
                for (int b = 0; b < n; b++)
                    if (!p[b].known && hypot(p[b].x - x, p[b].y - y) < tol) {
                        p[b].known = 1, p[b].i = p[a].i + di, p[b].j = p[a].j + dj;
                        grew = 1;
                    }
            }
        }
    }
}

/* Lower corner of the n x m window of indices with the most votes; the votes, and peaks inside. */
static double best_window(int at[2], int *inside, const peak *p, int np, int n, int m)
{
    double best = 0;
    for (int a = 0; a < np; a++)
        for (int b = 0; b < np; b++) {
            if (!p[a].known || !p[b].known) continue;
            double sum = 0;
            int count = 0;
            for (int k = 0; k < np; k++)
                if (p[k].known && p[k].i >= p[a].i && p[k].i < p[a].i + n && p[k].j >= p[b].j && p[k].j < p[b].j + m)
                    sum += p[k].votes, count++;
            if (sum > best) best = sum, at[0] = p[a].i, at[1] = p[b].j, *inside = count;
        }
    return best;
}

static int lattice(sphere_seen corner[4], peak *p, int np, double r, int n, int m, double rotate, int k, errmsg *e)
{
    /* +u in the picture: right, turned back by rotate; +v to its left */
    double c = cos(rotate), s = sin(rotate), u[2] = {c, s}, v[2] = {s, -c}, pu[2], pv[2];
    int have_u = n > 1 && median_step(pu, p, np, u[0], u[1], r), have_v = m > 1 && median_step(pv, p, np, v[0], v[1], r);
    if ((n > 1 && !have_u) || (m > 1 && !have_v))
        return err_set(e, "expected an array of %d x %d mirror spheres, found no rows of equal circles", n, m);
    if (!have_u) pu[0] = -pv[1], pu[1] = pv[0];
    if (!have_v) pv[0] = pu[1], pv[1] = -pu[0];
    index_peaks(p, np, pu, pv);
    int at[2] = {0, 0}, inside = 0;
    best_window(at, &inside, p, np, n, m);
    if (inside < (n * m * 3 + 3) / 4)
        return err_set(e, "expected %d x %d mirror spheres, found only %d circles in a grid; give --corners", n, m, inside);
    /* least squares for origin and steps within the window: position = o + i u + j v */
    double a[3][3] = {{0}}, bx[3] = {0}, by[3] = {0};
    for (int q = 0; q < np; q++) {
        double f[3] = {1, p[q].i - at[0], p[q].j - at[1]};
        if (!p[q].known || f[1] < 0 || f[1] >= n || f[2] < 0 || f[2] >= m) continue;
        for (int y = 0; y < 3; y++) {
            bx[y] += f[y] * p[q].x, by[y] += f[y] * p[q].y;
            for (int x = 0; x < 3; x++) a[y][x] += f[y] * f[x];
        }
    }
    if (n == 1) a[1][1] += 1;
    if (m == 1) a[2][2] += 1;
    for (int y = 0; y < 3; y++) /* elimination of a small, well-posed system */
        for (int z = 0; z < 3; z++) {
            if (z == y) continue;
            double f = a[z][y] / a[y][y];
            for (int x = 0; x < 3; x++) a[z][x] -= f * a[y][x];
            bx[z] -= f * bx[y], by[z] -= f * by[y];
        }
    for (int q = 0; q < 4; q++) {
        double i = q == 1 || q == 2 ? n - 1 : 0, j = q >= 2 ? m - 1 : 0;
        double x = bx[0] / a[0][0] + i * bx[1] / a[1][1] + j * bx[2] / a[2][2];
        double y = by[0] / a[0][0] + i * by[1] / a[1][1] + j * by[2] / a[2][2];
        /* the corner's own peak, where there is one: the steps are not quite even under perspective */
        for (int z = 0; z < np; z++)
            if (p[z].known && p[z].i - at[0] == (int)i && p[z].j - at[1] == (int)j) x = p[z].x, y = p[z].y;
        corner[q] = (sphere_seen){x * k, y * k, r * k};
    }
    return 0;
}

static int find_array(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate, errmsg *e)
{
    work a;
    int most = n * m + n + m + 4, np = 0, rc = -1;
    peak *p = NULL, *room = NULL;
    if (work_init(&a, pix, w, h)) {
        work_free(&a);
        return err_set(e, "expected a picture with edges, found none");
    }
    p = malloc(sizeof *p * (size_t)most), room = malloc(sizeof *room * (size_t)a.w * (size_t)a.h);
    if (!p || !room) {
        err_set(e, "out of memory");
        goto done;
    }
    int turned = fabs(sin(rotate)) > 0.7;
    double across = turned ? m : n, down = turned ? n : m;
    double rmax = 0.55 * fmin(a.w / across, a.h / down), rmin = fmax(0.2 * rmax, 3), best = 0, best_r = 0;
    for (double r = rmin; r <= rmax; r += fmax(0.5, 0.02 * r)) {
        vote(&a, (float)r);
        np = peaks(p, n * m, room, &a, r);
        double sum = 0;
        for (int k = 0; k < np; k++) sum += p[k].votes;
        sum /= r * n * m;
        if (sum > best) best = sum, best_r = r;
    }
    if (best > 0) {
        vote(&a, (float)best_r);
        np = peaks(p, most, room, &a, best_r);
        rc = lattice(corner, p, np, best_r, n, m, rotate, a.k, e);
    } else {
        err_set(e, "expected an array of %d x %d mirror spheres, found no circles", n, m);
    }
done:
    free(p);
    free(room);
    work_free(&a);
    return rc;
}

int sphere_find_corners(sphere_seen corner[4], const float *pix, int w, int h, int n, int m, double rotate, errmsg *e)
{
    if (n > 1 || m > 1) return find_array(corner, pix, w, h, n, m, rotate, e);
    circle_found f;
    if (circle_find(&f, pix, w, h, CIRCLE_BALL, 0, e)) return -1;
    for (int k = 0; k < 4; k++) corner[k] = (sphere_seen){f.x, f.y, f.r};
    return 0;
}
