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
 * Here the ray is brought into the plane's frame and to its four probes, in double, for the scene may lie far from the
 * world's origin; what the probes hold for it is ilf_look.h's.
 */
#include "ilf_look.h"

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
    return s > 0 ? s < n - 1 ? s : n - 1 : 0; /* also takes infinities; a NaN becomes 0 */
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* The largest coordinate's size. */
static double largest(vec a)
{
    return larger(fabs(a.u), larger(fabs(a.v), fabs(a.n)));
}

/* The direction in the frame, its largest coordinate brought to 1: for those whose squares might overflow or vanish. */
__attribute__((noinline, cold)) static int normal_direction(vec *d, const ilf_frame *fr, const double dir[3])
{
    vec a = to_frame(fr, dir);
    double size = largest(a);

    if (!(size < 1e300)) { /* sums of three that large may overflow */
        const double less[3] = {dir[0] * 0x1p-8, dir[1] * 0x1p-8, dir[2] * 0x1p-8};
        a = to_frame(fr, less);
        size = largest(a);
    }
    if (!(size > 0)) return 0;
    *d = (vec){a.u / size, a.v / size, a.n / size}; /* a reciprocal might overflow */
    return 1;
}

ilf_status ilf_eval(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3], const double dir[3],
                    const double *hit, ilf_mode mode, ilf_error *err)
{
    const double *from = hit ? hit : origin;
    const double finite = (from[0] - from[0]) + (from[1] - from[1]) + (from[2] - from[2]) + (dir[0] - dir[0]) +
                          (dir[1] - dir[1]) + (dir[2] - dir[2]); /* 0, else NaN */

    if (!(finite == 0)) return ilf_fail(err, ILF_ERR_ARG, "ray: expected finite coordinates");
    vec d = to_frame(fr, dir);
    if (!ilf_usual_size(largest(d)) && !normal_direction(&d, fr, dir))
        return ilf_fail(err, ILF_ERR_ARG, "ray: expected a direction that is not zero");

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
    const double w[4] = {(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b};
    const int64_t first = (int64_t)j0 * n_u + i0;
    ilf_cell cell;

    for (int k = 0; k < 4; k++) {
        /* a weight of 0 also keeps i < n_u, j < n_v; probe (i0, j0) has a weight always */
        const int64_t m = w[k] > 0 ? first + (k & 1) + (k >> 1) * (int64_t)n_u : first;
        const ilf_status st = ilf_need_probe(f, m, err);
        if (st != ILF_OK) return st;
        cell.w[k] = w[k];
        cell.probe[k] = &f->probes[m];
        cell.pix[k] = atomic_load_explicit(&f->probes[m].pix, memory_order_relaxed);
    }
    cell.d[0] = d.u, cell.d[1] = d.v, cell.d[2] = d.n;
    if (!hit || mode != ILF_DEPTH) {
        f->look[ILF_NO_DEPTH](rgb, f, &cell);
        return ILF_OK;
    }
    cell.h[0] = h.u, cell.h[1] = h.v, cell.h[2] = h.n;
    cell.i = n_u == 1 ? 1 : i0, cell.j = n_v == 1 ? 1 : j0;
    cell.len_u = len_u, cell.len_v = len_v, cell.cos_uv = fr->cos_uv;
    const int usual = ilf_usual_size(fabs(h.n)) && largest(h) < 1e100 && len_u < 1e100 && len_v < 1e100;
    (usual ? f->look[ILF_DEPTH] : ilf_look_plain_depth)(rgb, f, &cell);
    return ILF_OK;
}
