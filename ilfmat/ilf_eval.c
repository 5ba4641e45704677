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

/* Add w times the row's value at column coordinate (x0, x1, a). */
static void add_row(double rgb[3], const ilf *f, const unsigned char *row, size_t x0, size_t x1, double a, double w)
{
    for (int c = 0; c < 3; c++) {
        const unsigned char *p = row + f->chan_offset[c];
        const double t0 = ilf_texel(f, p + x0 * f->texel_bytes), t1 = ilf_texel(f, p + x1 * f->texel_bytes);
        rgb[c] += w * (t0 + a * (t1 - t0));
    }
}

static void add_pole(double rgb[3], const float pole[3], double w)
{
    for (int c = 0; c < 3; c++) rgb[c] += w * (double)pole[c];
}

/* Add w times probe p's radiance from direction d (any length > 0). */
static void add_probe(double rgb[3], const ilf *f, const probe *p, vec d, double w)
{
    const int nt = f->info.n_theta, np = f->info.n_phi;
    double phi = atan2(sqrt(d.u * d.u + d.v * d.v), d.n);
    const double theta = atan2(d.v, d.u);

    phi = fmin(phi, f->info.polar_valid);

    /* column: theta wraps */
    const double fx = (theta + ILF_PI) * (nt / (2 * ILF_PI)) - 0.5;
    const double cx = floor(fx), a = fx - cx;
    const size_t x0 = (size_t)(((int)cx % nt + nt) % nt), x1 = x0 + 1 == (size_t)nt ? 0 : x0 + 1;

    /* row: towards a pole the value goes to the mean of the nearest row */
    const double fy = phi * (np / f->info.polar_max) - 0.5;
    if (fy < 0) {
        const double t = fmax(2 * fy + 1, 0);
        add_pole(rgb, p->pole[0], w * (1 - t));
        add_row(rgb, f, p->pix, x0, x1, a, w * t);
    } else if (fy >= np - 1) {
        const unsigned char *last = p->pix + (size_t)(np - 1) * f->row_bytes;
        const double t = f->full_sphere ? fmin(2 * (fy - (np - 1)), 1) : 0;
        add_row(rgb, f, last, x0, x1, a, w * (1 - t));
        if (t > 0) add_pole(rgb, p->pole[1], w * t);
    } else {
        const size_t y0 = (size_t)fy;
        const double b = fy - (double)y0;
        const unsigned char *row = p->pix + y0 * f->row_bytes;
        add_row(rgb, f, row, x0, x1, a, w * (1 - b));
        add_row(rgb, f, row + f->row_bytes, x0, x1, a, w * b);
    }
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

ilf_status ilf_eval(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3], const double dir[3],
                    const double *hit, ilf_mode mode, ilf_error *err)
{
    const double *at = hit ? hit : origin;

    for (int c = 0; c < 3; c++)
        if (!isfinite(at[c]) || !isfinite(dir[c]))
            return ilf_fail(err, ILF_ERR_ARG, "ray: expected finite coordinates");
    vec d = to_frame(fr, dir);
    const double size = largest(d);
    if (!(size > 0 && isfinite(size))) return ilf_fail(err, ILF_ERR_ARG, "ray: expected a direction that is not zero");
    d = scaled(d, 1 / size);

    if (d.n <= 0) { /* no light from below the plane */
        rgb[0] = rgb[1] = rgb[2] = 0;
        return ILF_OK;
    }
    const double rel[3] = {at[0] - fr->origin[0], at[1] - fr->origin[1], at[2] - fr->origin[2]};
    const vec h = to_frame(fr, rel);
    /* back to the plane; at grazing angles the quotient may overflow, which the clamp takes */
    const double back = h.n == 0 ? 0 : h.n / d.n;
    const double pu = d.u == 0 ? h.u : h.u - d.u * back;
    const double pv = d.v == 0 ? h.v : h.v - d.v * back;
    const int n_u = f->info.n_u, n_v = f->info.n_v;
    const double s = grid_coordinate(pu, fr->len_u, n_u), t = grid_coordinate(pv, fr->len_v, n_v);
    const int i0 = (int)s, j0 = (int)t;
    const double a = s - i0, b = t - j0;
    double sum[3] = {0, 0, 0};

    for (int k = 0; k < 4; k++) {
        const int i = i0 + (k & 1), j = j0 + (k >> 1);
        const double w = (k & 1 ? a : 1 - a) * (k >> 1 ? b : 1 - b);

        if (w <= 0) continue; /* also keeps i < n_u, j < n_v */
        const int64_t m = (int64_t)j * n_u + i;
        const ilf_status st = ilf_need_probe(f, m, err);
        if (st != ILF_OK) return st;
        vec look = d;
        if (hit && mode == ILF_DEPTH) {
            const double qu = probe_position(i, fr->len_u, n_u), qv = probe_position(j, fr->len_v, n_v);
            const vec to = {h.u - qu - qv * fr->cos_uv, h.v - qv - qu * fr->cos_uv, h.n};
            const double dist = largest(to);
            if (dist > 0) look = scaled(to, 1 / dist);
        }
        add_probe(sum, f, &f->probes[m], look, w);
    }
    for (int c = 0; c < 3; c++) rgb[c] = (float)sum[c];
    return ILF_OK;
}
