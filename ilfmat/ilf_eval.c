/*
 * ilf_eval.c - radiance along a ray: paper sections 5.1 (general algorithm) and 5.2 (depth
 * correction), bilinear in space and in direction.
 *
 *      h  auxiliary geometry           The ray through h is traced back to the plane at p; the
 *      |\                              four probes around p are mixed bilinearly.  Without depth
 *      | \  d                          correction all are looked up in direction d, with it
 *      |  \                            probe q in direction h - q.
 *   ---q---p--q---  plane
 *
 * Everything is computed in double: the field's texels may differ a thousandfold from one
 * to the next, which multiplies any error of position, and the scene may lie far from the
 * world's origin.
 */
#include "ilf_angle.h"
#include "ilf_internal.h"

/* Coordinates in the plane's frame. */
typedef struct vec {
    double u, v, n;
} vec;

static vec to_frame(const ilf_frame *fr, const double a[3])
{
    return (vec){a[0] * fr->u[0] + a[1] * fr->u[1] + a[2] * fr->u[2],
                 a[0] * fr->v[0] + a[1] * fr->v[1] + a[2] * fr->v[2],
                 a[0] * fr->n[0] + a[1] * fr->n[1] + a[2] * fr->n[2]};
}

/* Grid coordinate of plane coordinate x along an edge of length len with n probes, clamped. */
static double grid_coordinate(double x, double len, int n)
{
    if (n == 1) return 0;
    const double s = x / len * (n - 1);
    return fmin(fmax(s, 0), n - 1); /* also takes infinities; a NaN becomes 0 */
}

/* Position of probe i along an edge; a single probe stands in the middle. */
static double probe_position(int i, double len, int n)
{
    return n == 1 ? 0.5 * len : len * i / (n - 1);
}

/* Where a direction falls in a probe: the same in all of them when there is no depth correction. */
typedef struct place {
    size_t x0, x1; /* bytes from the row's start to the two columns' texels */
    double a;      /* weight of the second column */
    size_t row;    /* bytes to the first row */
    double top;    /* weight of the first row; the rest is below's */
    enum { NEXT_ROW, POLE_ABOVE, POLE_BELOW, NOTHING } below;
} place;

static place find_place(const ilf *f, vec d)
{
    const int nt = f->info.n_theta, np = f->info.n_phi;
    const double phi = fmin(ilf_atan2(sqrt(d.u * d.u + d.v * d.v), d.n), f->info.polar_valid);
    const double theta = ilf_atan2(d.v, d.u);
    place at;

    /* column: theta wraps; fx lies in [-1/2, n_theta - 1/2] */
    const double fx = (theta + ILF_PI) * (nt / (2 * ILF_PI)) - 0.5;
    int x0 = (int)(fx + 1) - 1, x1 = x0 + 1;
    at.a = fx - x0;
    if (x0 < 0) x0 += nt;
    if (x0 >= nt) x0 -= nt;
    if (x1 >= nt) x1 -= nt;
    at.x0 = (size_t)x0 * f->texel_bytes;
    at.x1 = (size_t)x1 * f->texel_bytes;

    /* row: towards a pole the value goes to the mean of the nearest row */
    const double fy = phi * (np / f->info.polar_max) - 0.5;
    if (fy < 0) {
        at.row = 0;
        at.top = fmax(2 * fy + 1, 0);
        at.below = POLE_ABOVE;
    } else if (fy >= np - 1) {
        at.row = (size_t)(np - 1) * f->row_bytes;
        at.top = f->full_sphere ? 1 - fmin(2 * (fy - (np - 1)), 1) : 1;
        at.below = f->full_sphere ? POLE_BELOW : NOTHING;
    } else {
        const int y0 = (int)fy;
        at.row = (size_t)y0 * f->row_bytes;
        at.top = 1 - (fy - y0);
        at.below = NEXT_ROW;
    }
    return at;
}

/* Add w times probe p's radiance at a place: as rows to be read, or to sum. */
static int add_probe(ilf_tap *tap, double sum[3], const ilf *f, const probe *p, const place *at, double w)
{
    const double top = w * at->top, rest = w - top;

    tap[0] = (ilf_tap){p->pix + at->row, at->x0, at->x1, top - top * at->a, top * at->a};
    switch (at->below) {
    case NEXT_ROW:
        tap[1] = (ilf_tap){tap[0].row + f->row_bytes, at->x0, at->x1, rest - rest * at->a, rest * at->a};
        return 2;
    case POLE_ABOVE:
    case POLE_BELOW:
        for (int c = 0; c < 3; c++) sum[c] += rest * (double)p->pole[at->below == POLE_BELOW][c];
        break;
    case NOTHING:
        break;
    }
    return 1;
}

/* The largest coordinate's size, so that directions of any length can be brought near 1. */
static double largest(vec a)
{
    return fmax(fabs(a.u), fmax(fabs(a.v), fabs(a.n)));
}

static vec scaled(vec a, double s)
{
    return (vec){a.u * s, a.v * s, a.n * s};
}

/* The same direction, its largest coordinate (size > 0) brought to 1. */
static vec normal_size(vec a, double size)
{
    if (size > 1e-300) return scaled(a, 1 / size);
    return (vec){a.u / size, a.v / size, a.n / size}; /* the reciprocal would overflow */
}

ilf_status ilf_eval(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3], const double dir[3],
                    const double *hit, ilf_mode mode, ilf_error *err)
{
    const double *from = hit ? hit : origin;

    for (int c = 0; c < 3; c++)
        if (!isfinite(from[c]) || !isfinite(dir[c]))
            return ilf_fail(err, ILF_ERR_ARG, "ray: expected finite coordinates");
    vec d = to_frame(fr, dir);
    double size = largest(d);
    if (!(size < 1e300)) { /* sums of three that large may overflow */
        const double less[3] = {dir[0] * 0x1p-8, dir[1] * 0x1p-8, dir[2] * 0x1p-8};
        d = to_frame(fr, less);
        size = largest(d);
    }
    if (!(size > 0)) return ilf_fail(err, ILF_ERR_ARG, "ray: expected a direction that is not zero");
    d = normal_size(d, size);

    if (d.n <= 0) { /* no light from below the plane */
        rgb[0] = rgb[1] = rgb[2] = 0;
        return ILF_OK;
    }
    double rel[3] = {from[0] - fr->origin[0], from[1] - fr->origin[1], from[2] - fr->origin[2]}, unit = 1;
    vec h = to_frame(fr, rel);
    if (!(largest(h) < 1e300)) { /* in a larger unit, then: its differences and sums may overflow */
        unit = 0x1p-8;
        for (int c = 0; c < 3; c++) rel[c] = from[c] * unit - fr->origin[c] * unit;
        h = to_frame(fr, rel);
    }
    const double len_u = fr->len_u * unit, len_v = fr->len_v * unit;
    /* back to the plane; at grazing angles the quotient may overflow, which the clamp takes */
    const double back = h.n == 0 ? 0 : h.n / d.n;
    const double pu = d.u == 0 ? h.u : h.u - d.u * back;
    const double pv = d.v == 0 ? h.v : h.v - d.v * back;
    const int n_u = f->info.n_u, n_v = f->info.n_v;
    const double s = grid_coordinate(pu, len_u, n_u), t = grid_coordinate(pv, len_v, n_v);
    const int i0 = (int)s, j0 = (int)t;
    const double a = s - i0, b = t - j0;
    const int corrected = hit && mode == ILF_DEPTH;
    double sum[3] = {0, 0, 0};
    ilf_tap tap[8];
    int taps = 0;
    place at = {0};

    if (!corrected) at = find_place(f, d);
    for (int k = 0; k < 4; k++) {
        const int i = i0 + (k & 1), j = j0 + (k >> 1);
        const double w = (k & 1 ? a : 1 - a) * (k >> 1 ? b : 1 - b);

        if (w <= 0) continue; /* also keeps i < n_u, j < n_v */
        const int64_t m = (int64_t)j * n_u + i;
        const ilf_status st = ilf_need_probe(f, m, err);
        if (st != ILF_OK) return st;
        if (corrected) {
            const double qu = probe_position(i, len_u, n_u), qv = probe_position(j, len_v, n_v);
            const vec to = {h.u - qu - qv * fr->cos_uv, h.v - qv - qu * fr->cos_uv, h.n};
            const double dist = largest(to);
            at = find_place(f, dist > 0 ? normal_size(to, dist) : d);
        }
        taps += add_probe(tap + taps, sum, f, &f->probes[m], &at, w);
    }
    f->sum(sum, f, tap, taps);
    for (int c = 0; c < 3; c++) rgb[c] = (float)sum[c];
    return ILF_OK;
}
