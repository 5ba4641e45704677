/*
 * ilf_patch.c - a bright patch of a probe as a ball around the place where its light comes from.
 *
 *      ( )  patch's ball          The ball holds all directions in which a bilinear lookup can see the
 *       \   \                     patch's texels: half a texel more on each side, all of the cap around the
 *        \  |                     pole for the first row, and down to the horizon for the last row that
 *     ----q------  plane          is valid.
 *
 * Where that is: where the auxiliary geometry is met if the lookups are depth-corrected, else far away.
 */
#include <stdlib.h>

#include "ilf_sampler.h"

/* A patch wider than that is looked at in more places. */
#define LARGE_PATCH (10 * ILF_PI / 180)

/* A ball's rim bulges a little between the looks. */
#define BULGE 1.05

/* Light that is infinitely far away is put here, in units of the sampled rectangle's size. */
#define FAR_AWAY 1e5

double ilf_far_away(const ilf_frame *fr)
{
    return FAR_AWAY * (fr->len_u + fr->len_v);
}

static void direction(double d[3], double theta, double phi)
{
    d[0] = sin(phi) * cos(theta);
    d[1] = sin(phi) * sin(theta);
    d[2] = cos(phi);
}

static void to_world(double w[3], const ilf_frame *fr, const double d[3])
{
    for (int c = 0; c < 3; c++) w[c] = d[0] * fr->u[c] + d[1] * fr->v[c] + d[2] * fr->n[c];
}

static double distance3(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* One look from a probe: in direction (theta, phi) light comes from p, at distance t.  part < 0: from
 * nowhere. */
typedef struct look {
    double theta, phi, p[3], t;
    int part;
} look;

/* Steps of the distance, as factors: from one part of a patch to another, and from a thing to the next behind
 * it. */
#define JUMP   1.1
#define BEHIND 1.03

/* Where light from direction (theta, phi) reaches probe position q (plane's coordinates) from; or, with
 * beyond > 0, what stands behind what is at that distance. */
static look look_along(const ilf_patches *pl, const double q[3], double theta, double phi, double beyond)
{
    const ilf_frame *fr = &pl->frame;
    look l = {.theta = theta, .phi = phi};
    double d[3];

    direction(d, theta, phi);
    if (pl->mode == ILF_DEPTH && pl->hit) {
        double origin[3], dir[3], hit[3];

        to_world(origin, fr, q);
        to_world(dir, fr, d);
        for (int c = 0; c < 3; c++) origin[c] += fr->origin[c] + BEHIND * beyond * dir[c];
        if (pl->hit(hit, origin, dir, pl->context)) {
            for (int c = 0; c < 3; c++) hit[c] -= fr->origin[c];
            for (int c = 0; c < 3; c++) {
                const double *axis = c == 0 ? fr->u : c == 1 ? fr->v : fr->n;
                l.p[c] = hit[0] * axis[0] + hit[1] * axis[1] + hit[2] * axis[2];
            }
            l.t = distance3(l.p, q);
            return l;
        }
    }
    if (beyond > 0) {
        l.part = -1;
        return l;
    }
    l.t = ilf_far_away(fr);
    for (int c = 0; c < 3; c++) l.p[c] = q[c] + l.t * d[c];
    return l;
}

/* A patch at the edge of something lies half on what is behind: one ball around both would hold most of the
 * room.  So the looks of a patch are parted at jumps of their distance, and each part has a ball of its own.
 * A lookup asks for the direction from the probe to where the ray ends: what a probe sees on a lamp shows on
 * the wall behind it, too, from where the lamp does not hide the wall.  So there are such balls for each
 * layer of things. */
enum { LARGE_STEPS = 8, SMALL_STEPS = 2, MAX_PARTS = 4, HALVINGS = 3, MAX_LAYERS = 6 };
enum {
    GRID = (LARGE_STEPS + 1) * (LARGE_STEPS + 1),
    MAX_LOOKS = GRID + 2 * HALVINGS * LARGE_STEPS * (LARGE_STEPS + 1)
};

static int by_distance(const void *a, const void *b)
{
    const double x = (*(const look *const *)a)->t, y = (*(const look *const *)b)->t;

    return (x > y) - (x < y);
}

/* The ball around the looks of a part, about look `middle` or, if that is negative, about their middle;
 * returns the least distance. */
static double ball(double centre[3], double *radius, const look *l, int n, int part, int middle)
{
    double lo[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, hi[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL},
           least = HUGE_VAL;

    for (int k = 0; k < n; k++) {
        if (l[k].part != part) continue;
        least = fmin(least, l[k].t);
        for (int c = 0; c < 3; c++) lo[c] = fmin(lo[c], l[k].p[c]), hi[c] = fmax(hi[c], l[k].p[c]);
    }
    for (int c = 0; c < 3; c++) centre[c] = middle < 0 ? 0.5 * (lo[c] + hi[c]) : l[middle].p[c];
    *radius = 0;
    for (int k = 0; k < n; k++)
        if (l[k].part == part) *radius = fmax(*radius, distance3(l[k].p, centre));
    return least;
}

/* Part the n looks of a grid, if a part's ball is larger than a wall across the view would make it.  Returns
 * how many parts there are. */
static int find_parts(look *l, int n, double half)
{
    int parts = 1;

    for (int k = 0; k < parts && parts < MAX_PARTS;) {
        look *sorted[GRID];
        double centre[3], radius, jump = JUMP;
        int m = 0, at = 0;

        if (ball(centre, &radius, l, n, k, -1) * 2 * half < radius) {
            for (int a = 0; a < n; a++)
                if (l[a].part == k) sorted[m++] = &l[a];
            qsort(sorted, (size_t)m, sizeof *sorted, by_distance);
            for (int a = 1; a < m; a++)
                if (sorted[a]->t > jump * sorted[a - 1]->t) jump = sorted[a]->t / sorted[a - 1]->t, at = a;
        }
        if (at)
            while (at < m) sorted[at++]->part = parts;
        parts += at != 0;
        k += at == 0;
    }
    return parts;
}

/* Look where between two neighbours one part ends and the other begins. */
static int find_edge(look *more, const ilf_patches *pl, const double q[3], look a, look b)
{
    for (int k = 0; k < HALVINGS; k++) {
        look m = look_along(pl, q, 0.5 * (a.theta + b.theta), 0.5 * (a.phi + b.phi), 0);

        if (m.t * m.t < a.t * b.t ? a.t < b.t : a.t > b.t) {
            m.part = a.part;
            a = m;
        } else {
            m.part = b.part;
            b = m;
        }
        more[k] = m;
    }
    return HALVINGS;
}

static patch *add_patch(ilf_patches *pl)
{
    if (pl->n == pl->room) {
        const size_t room = pl->room ? 2 * pl->room : 1024;
        patch *p = realloc(pl->p, room * sizeof *p);

        if (!p) return NULL;
        pl->p = p;
        pl->room = room;
    }
    return &pl->p[pl->n++];
}

int ilf_make_patch(ilf_patches *pl, int i, int j, const int x[2], const int y[2], double excess)
{
    const ilf_info *in = &pl->field->info;
    const double dt = 2 * ILF_PI / in->n_theta, dp = in->polar_max / in->n_phi;
    const double q[3] = {in->n_u == 1 ? 0.5 * pl->frame.len_u : pl->frame.len_u * i / (in->n_u - 1),
                         in->n_v == 1 ? 0.5 * pl->frame.len_v : pl->frame.len_v * j / (in->n_v - 1), 0};
    double lo = (y[0] - 0.5) * dp, hi = (y[1] + 0.5) * dp;
    const int at_pole = y[0] == 0;
    const double middle = 0.5 * (x[0] + x[1]) * dt - ILF_PI;
    const double side = at_pole ? ILF_PI : fmin((0.5 * (x[1] - x[0]) + 0.5) * dt, ILF_PI);
    look l[MAX_LOOKS];

    if (y[1] >= ilf_patch_rows(pl)) hi = fmax(hi, ILF_PI / 2);
    hi = fmin(hi, ILF_PI);
    lo = at_pole ? 0 : fmax(lo, 0);
    /* a small patch by corners and middles of its sides; in a large one the geometry may be anything */
    const double across = 2 * side * sin(fmin(hi, ILF_PI / 2));
    const int steps = at_pole || fmax(across, hi - lo) > LARGE_PATCH ? LARGE_STEPS : SMALL_STEPS,
              row = steps + 1;
    const double half = 0.5 * hypot(at_pole ? 2 * hi : across, at_pole ? 0 : hi - lo),
                 step = fmax(across, hi - lo) / steps;
    for (int k = 0; k < row * row; k++)
        l[k] = look_along(pl, q, middle + side * (2.0 * (k % row) / steps - 1),
                          lo + (hi - lo) * (k / row) / steps, 0);
    for (int layer = 0, there = row * row; layer < MAX_LAYERS && there; layer++) {
        const int whole = there == row * row;
        const int parts = find_parts(l, row * row, half);
        int n = row * row;

        if (layer == 0 && parts > 1)
            for (int k = 0; k < row * row; k++) {
                if (k % row < steps && l[k].part != l[k + 1].part)
                    n += find_edge(l + n, pl, q, l[k], l[k + 1]);
                if (k + row < row * row && l[k].part != l[k + row].part)
                    n += find_edge(l + n, pl, q, l[k], l[k + row]);
            }
        for (int k = 0; k < parts; k++) {
            patch *p = add_patch(pl);
            double centre[3], radius;

            if (!p) return -1;
            const double least = ball(centre, &radius, l, n, k,
                                      parts > 1 || !whole ? -1
                                      : at_pole           ? 0
                                                          : row * row / 2);
            /* an edge is known to a part of a step, or to a step */
            radius *= BULGE;
            if (layer > 0) radius += least * step;
            else if (parts > 1) radius += least * step / (1 << HALVINGS);
            *p = (patch){(float)centre[0],
                         (float)centre[1],
                         (float)centre[2],
                         (float)radius,
                         (float)excess,
                         i,
                         j,
                         layer == 0 && parts == 1};
        }
        there = 0;
        for (int k = 0; k < row * row; k++) {
            if (l[k].part >= 0) l[k] = look_along(pl, q, l[k].theta, l[k].phi, l[k].t);
            there += l[k].part >= 0;
        }
    }
    return 0;
}
