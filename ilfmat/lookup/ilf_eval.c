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
 *
 * This is the lookup of any ray on any processor; ilf_eval_avx2.c has that of usual rays faster.
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

/* The largest coordinate's size. */
static double largest(vec a)
{
    return fmax(fabs(a.u), fmax(fabs(a.v), fabs(a.n)));
}

/* The direction in the frame, its largest coordinate brought to 1. */
static int normal_direction(vec *d, const ilf_frame *fr, const double dir[3])
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

/* The cell of the grid that the ray crosses; probe k stands in column k & 1, row k >> 1 of it. */
typedef struct cell {
    double w[4];                 /* weights */
    int64_t m[4];                /* the probes' numbers, where the weight is above 0 */
    const unsigned char *pix[4]; /* their texels */
    vec d;                       /* direction */
    /* with depth correction only */
    vec h;                       /* where the ray meets the geometry, from probe (0, 0) */
    double i, j;                 /* column and row of probe 0, of span_u and span_v */
    double len_u, len_v, cos_uv; /* edges of the sampled rectangle, cosine between them */
} cell;

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
    const double fx = (theta + ILF_PI) * f->columns_per_radian - 0.5;
    int x0 = (int)(fx + 1) - 1, x1 = x0 + 1;
    at.a = fx - x0;
    if (x0 < 0) x0 += nt;
    if (x0 >= nt) x0 -= nt;
    if (x1 >= nt) x1 -= nt;
    at.x0 = (size_t)x0 * f->pixel_bytes;
    at.x1 = (size_t)x1 * f->pixel_bytes;

    /* row: towards a pole the value goes to the mean of the nearest row */
    const double fy = phi * f->rows_per_radian - 0.5;
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

/* Add w times two neighbouring texels of a row. */
static void add_row(double sum[3], const ilf *f, const unsigned char *row, const place *at, double w)
{
    const double w1 = w * at->a, w0 = w - w1;

    for (int c = 0; c < 3; c++) {
        const unsigned char *p = row + f->chan_offset[c];
        sum[c] += w0 * ilf_texel_of(p + at->x0, f->is_half) + w1 * ilf_texel_of(p + at->x1, f->is_half);
    }
}

/* Add probe k's radiance at a place. */
static void add_probe(double sum[3], const ilf *f, const cell *cl, int k, const place *at)
{
    const unsigned char *row = cl->pix[k] + at->row;
    const double top = cl->w[k] * at->top, rest = cl->w[k] - top;

    add_row(sum, f, row, at, top);
    if (at->below == NEXT_ROW) add_row(sum, f, row + f->row_bytes, at, rest);
    else if (at->below != NOTHING)
        for (int c = 0; c < 3; c++)
            sum[c] += rest * (double)f->probes[cl->m[k]].pole[at->below == POLE_BELOW][c];
}

/* Direction from probe k to the hit, its largest coordinate brought to 1; the ray's own where the two
 * coincide. */
static vec towards_hit(const ilf *f, const cell *cl, int k)
{
    const double qu = cl->len_u * (cl->i + (k & 1)) / f->span_u,
                 qv = cl->len_v * (cl->j + (k >> 1)) / f->span_v;
    const vec to = {cl->h.u - qu - qv * cl->cos_uv, cl->h.v - qv - qu * cl->cos_uv, cl->h.n};
    const double size = largest(to);

    if (size > 0) return (vec){to.u / size, to.v / size, to.n / size};
    return cl->d;
}

ilf_status ilf_eval_plain(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3],
                          const double dir[3], const double *hit, ilf_mode mode, ilf_error *err)
{
    const double *from = hit ? hit : origin;

    for (int c = 0; c < 3; c++)
        if (!isfinite(from[c]) || !isfinite(dir[c]))
            return ilf_fail(err, ILF_ERR_ARG, "ray: expected finite coordinates");
    vec d;
    if (!normal_direction(&d, fr, dir))
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
    const int corrected = hit && mode == ILF_DEPTH;
    double sum[3] = {0, 0, 0};
    cell cl = {.d = d,
               .h = h,
               .i = n_u == 1 ? 1 : i0,
               .j = n_v == 1 ? 1 : j0,
               .len_u = len_u,
               .len_v = len_v,
               .cos_uv = fr->cos_uv};
    place at = {0};

    if (!corrected) at = find_place(f, d);
    for (int k = 0; k < 4; k++) {
        cl.w[k] = w[k];
        if (w[k] <= 0) continue; /* also keeps i < n_u, j < n_v */
        cl.m[k] = (int64_t)(j0 + (k >> 1)) * n_u + i0 + (k & 1);
        do { /* another thread may have had its memory given back */
            const ilf_status st = ilf_need_probe(f, cl.m[k], err);
            if (st != ILF_OK) return st;
            cl.pix[k] = atomic_load_explicit(&f->pix[cl.m[k]], memory_order_acquire);
        } while (!cl.pix[k]);
        if (corrected) at = find_place(f, towards_hit(f, &cl, k));
        add_probe(sum, f, &cl, k, &at);
    }
    for (int c = 0; c < 3; c++) rgb[c] = (float)sum[c];
    return ILF_OK;
}

static ilf_status eval_once(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3],
                            const double dir[3], const double *hit, ilf_mode mode, ilf_error *err)
{
    const int corrected = hit && mode == ILF_DEPTH;

    if (f->fast[corrected]) {
        const int st = f->fast[corrected](rgb, f, fr, hit ? hit : origin, dir, err);
        if (st != ILF_UNUSUAL) return (ilf_status)st;
    }
    return ilf_eval_plain(rgb, f, fr, origin, dir, hit, mode, err);
}

ilf_status ilf_eval_residual(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3],
                             const double dir[3], const double *hit, ilf_mode mode, ilf_error *err)
{
    if (!f->memory.most) return eval_once(rgb, f, fr, origin, dir, hit, mode, err);
    for (;;) { /* until no probe's memory was used for another meanwhile: see ilf_memory.c */
        const unsigned before = atomic_load_explicit(&f->memory.given_back, memory_order_acquire);
        const ilf_status st = eval_once(rgb, f, fr, origin, dir, hit, mode, err);
        atomic_thread_fence(memory_order_acquire);
        if (st != ILF_OK || atomic_load_explicit(&f->memory.given_back, memory_order_relaxed) == before)
            return st;
    }
}
