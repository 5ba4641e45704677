/*
 * ilf_patches.c - find what is bright in a light field.
 *
 * Each probe is looked through once, and texels whose luminance exceeds the threshold are gathered into
 * patches of about a degree.  A patch is kept as a ball around the place where its light comes from: where
 * the auxiliary geometry is met if the lookups are depth-corrected, else far away in its direction.
 *
 *      ( )  patch's ball          The ball holds all directions in which a bilinear lookup can see the
 *       \   \                     patch's texels: half a texel more on each side, all of the cap around the
 *        \  |                     pole for the first row, and down to the horizon for the last row that
 *     ----q------  plane          is valid.
 */
#include <stdlib.h>

#include "ilf_sampler.h"

/* Angular size of a patch that is aimed at, and how many patches are too many. */
#define PATCH_SIZE  (1.0 * ILF_PI / 180)
#define MAX_PATCHES 36000
#define LARGE_PATCH (10 * ILF_PI / 180)

/* Light that is infinitely far away is put here, in units of the sampled rectangle's size. */
#define FAR_AWAY 1e5

/* ---- texels --------------------------------------------------------------------------------- */

/* An upper bound of the row's values: the bits of positive floats and halves order as integers do. */
static float row_bound(const ilf *f, const unsigned char *row)
{
    if (f->is_half) {
        int16_t m = 0;
        for (size_t k = 0; k < f->row_bytes; k += 2) {
            int16_t v;
            memcpy(&v, row + k, sizeof v);
            if (v > m) m = v;
        }
        return half_to_float((uint16_t)m);
    }
    int32_t m = 0;
    for (size_t k = 0; k < f->row_bytes; k += 4) {
        int32_t v;
        memcpy(&v, row + k, sizeof v);
        if (v > m) m = v;
    }
    float b;
    memcpy(&b, &m, sizeof b);
    return b;
}

static double texel_luminance(const ilf *f, const unsigned char *row, int x)
{
    const size_t at = (size_t)x * f->pixel_bytes;
    const float rgb[3] = {ilf_texel(f, row + f->chan_offset[0] + at),
                          ilf_texel(f, row + f->chan_offset[1] + at),
                          ilf_texel(f, row + f->chan_offset[2] + at)};

    return ilf_luminance(rgb);
}

/* Rows that lookups above the plane can reach. */
static int valid_rows(const ilf *f)
{
    const double edge = fmin(f->info.polar_valid, ILF_PI / 2) * f->info.n_phi / f->info.polar_max - 0.5;
    const int rows = (int)ceil(edge) + 1;

    return rows < 1 ? 1 : rows > f->info.n_phi ? f->info.n_phi : rows;
}

/* Mean over the hemisphere of what a few probes spread over the grid (a threshold needs no more) have of
 * luminance above 0: texels below it, where a background was subtracted too far, say nothing of where the
 * bright ones begin. */
static ilf_status mean_luminance(double *mean, const ilf *f, ilf_error *err)
{
    const int most = 6, rows = valid_rows(f), n_u = f->info.n_u, n_v = f->info.n_v;
    const int k_u = n_u < most ? n_u : most, k_v = n_v < most ? n_v : most;
    double sum = 0, omega = 0;

    for (int b = 0; b < k_v; b++)
        for (int a = 0; a < k_u; a++) {
            const int i = k_u > 1 ? a * (n_u - 1) / (k_u - 1) : 0,
                      j = k_v > 1 ? b * (n_v - 1) / (k_v - 1) : 0;
            const unsigned char *pix;
            void *own;
            const ilf_status st = ilf_peek_probe(f, (int64_t)j * n_u + i, &pix, &own, err);

            if (st != ILF_OK) return st;
            for (int y = 0; y < rows; y++) {
                const double step = f->info.polar_max / f->info.n_phi;
                const double w = cos(y * step) - cos((y + 1) * step);
                double row = 0;
                for (int x = 0; x < f->info.n_theta; x++)
                    row += fmax(texel_luminance(f, pix + (size_t)y * f->row_bytes, x), 0);
                sum += w * row / f->info.n_theta;
                omega += w;
            }
            ilf_unpeek_probe(f, pix, own);
        }
    *mean = sum / omega;
    return ILF_OK;
}

/* ---- geometry ------------------------------------------------------------------------------- */

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
static look look_along(const ilf_sampler *s, const double q[3], double theta, double phi, double beyond)
{
    const ilf_frame *fr = &s->frame;
    look l = {.theta = theta, .phi = phi};
    double d[3];

    direction(d, theta, phi);
    if (s->spec.mode == ILF_DEPTH && s->spec.hit) {
        double origin[3], dir[3], hit[3];

        to_world(origin, fr, q);
        to_world(dir, fr, d);
        for (int c = 0; c < 3; c++) origin[c] += fr->origin[c] + BEHIND * beyond * dir[c];
        if (s->spec.hit(hit, origin, dir, s->spec.context)) {
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
    l.t = FAR_AWAY * (fr->len_u + fr->len_v);
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
static int find_edge(look *more, const ilf_sampler *s, const double q[3], look a, look b)
{
    for (int k = 0; k < HALVINGS; k++) {
        look m = look_along(s, q, 0.5 * (a.theta + b.theta), 0.5 * (a.phi + b.phi), 0);

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

static patch *add_patch(patch_list *l)
{
    if (l->n == l->room) {
        const size_t room = l->room ? 2 * l->room : 1024;
        patch *p = realloc(l->p, room * sizeof *p);

        if (!p) return NULL;
        l->p = p;
        l->room = room;
    }
    return &l->p[l->n++];
}

/* Add the balls for texels [x0, x1) x [y0, y1) of probe (i, j). */
static int make_patch(ilf_sampler *s, int i, int j, const int x[2], const int y[2], double excess)
{
    const ilf_info *in = &s->field->info;
    const double dt = 2 * ILF_PI / in->n_theta, dp = in->polar_max / in->n_phi;
    const double q[3] = {in->n_u == 1 ? 0.5 * s->frame.len_u : s->frame.len_u * i / (in->n_u - 1),
                         in->n_v == 1 ? 0.5 * s->frame.len_v : s->frame.len_v * j / (in->n_v - 1), 0};
    double lo = (y[0] - 0.5) * dp, hi = (y[1] + 0.5) * dp;
    const int at_pole = y[0] == 0;
    const double middle = 0.5 * (x[0] + x[1]) * dt - ILF_PI;
    const double side = at_pole ? ILF_PI : fmin((0.5 * (x[1] - x[0]) + 0.5) * dt, ILF_PI);
    look l[MAX_LOOKS];

    if (y[1] >= valid_rows(s->field)) hi = fmax(hi, ILF_PI / 2);
    hi = fmin(hi, ILF_PI);
    lo = at_pole ? 0 : fmax(lo, 0);
    /* a small patch by corners and middles of its sides; in a large one the geometry may be anything */
    const double across = 2 * side * sin(fmin(hi, ILF_PI / 2));
    const int steps = at_pole || fmax(across, hi - lo) > LARGE_PATCH ? LARGE_STEPS : SMALL_STEPS,
              row = steps + 1;
    const double half = 0.5 * hypot(at_pole ? 2 * hi : across, at_pole ? 0 : hi - lo),
                 step = fmax(across, hi - lo) / steps;
    for (int k = 0; k < row * row; k++)
        l[k] = look_along(s, q, middle + side * (2.0 * (k % row) / steps - 1),
                          lo + (hi - lo) * (k / row) / steps, 0);
    for (int layer = 0, there = row * row; layer < MAX_LAYERS && there; layer++) {
        const int whole = there == row * row;
        const int parts = find_parts(l, row * row, half);
        int n = row * row;

        if (layer == 0 && parts > 1)
            for (int k = 0; k < row * row; k++) {
                if (k % row < steps && l[k].part != l[k + 1].part)
                    n += find_edge(l + n, s, q, l[k], l[k + 1]);
                if (k + row < row * row && l[k].part != l[k + row].part)
                    n += find_edge(l + n, s, q, l[k], l[k + row]);
            }
        for (int k = 0; k < parts; k++) {
            patch *p = add_patch(&s->patches);
            double centre[3], radius;

            if (!p) return -1;
            const double least = ball(centre, &radius, l, n, k,
                                      parts > 1 || !whole ? -1
                                      : at_pole           ? 0
                                                          : row * row / 2);
            /* the rim bulges a little between the looks, and an edge is known to a part of a step, or to a
             * step */
            radius *= 1.05;
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
            if (l[k].part >= 0) l[k] = look_along(s, q, l[k].theta, l[k].phi, l[k].t);
            there += l[k].part >= 0;
        }
    }
    return 0;
}

/* ---- list ----------------------------------------------------------------------------------- */

/* Largest excess in each block of bx texels of rows [y0, y1); 1 if there is any. */
static int band_excess(float *block, int bx, int y0, int y1, const ilf_sampler *s, const unsigned char *pix)
{
    const ilf *f = s->field;
    int any = 0;

    for (int y = y0; y < y1; y++) {
        const unsigned char *row = pix + (size_t)y * f->row_bytes;

        if ((double)row_bound(f, row) <= s->threshold)
            continue; /* luminance is at most the largest channel */
        if (!any) memset(block, 0, (size_t)((f->info.n_theta + bx - 1) / bx) * sizeof *block);
        any = 1;
        for (int x = 0; x < f->info.n_theta; x++) {
            const float over = (float)(texel_luminance(f, row, x) - s->threshold);
            if (over > block[x / bx]) block[x / bx] = over;
        }
    }
    return any;
}

static ilf_status probe_patches(ilf_sampler *s, int i, int j, double size, float *block, ilf_error *err)
{
    const ilf *f = s->field;
    const double dt = 2 * ILF_PI / f->info.n_theta, dp = f->info.polar_max / f->info.n_phi;
    const int rows = valid_rows(f), by = dp >= size ? 1 : (int)fmin(size / dp + 0.5, rows);
    const unsigned char *pix;
    void *own;
    ilf_status st = ilf_peek_probe(f, (int64_t)j * f->info.n_u + i, &pix, &own, err);

    if (st != ILF_OK) return st;
    for (int y0 = 0; y0 < rows && st == ILF_OK; y0 += by) {
        const int y1 = y0 + by < rows ? y0 + by : rows;
        const double around = dt * sin((y0 + y1) * 0.5 * dp);
        const int bx = around * f->info.n_theta <= size ? f->info.n_theta
                       : around >= size                 ? 1
                                                        : (int)(size / around + 0.5);

        if (!band_excess(block, bx, y0, y1, s, pix)) continue;
        for (int x0 = 0; x0 < f->info.n_theta; x0 += bx) {
            const int x[2] = {x0, x0 + bx < f->info.n_theta ? x0 + bx : f->info.n_theta}, y[2] = {y0, y1};

            if (block[x0 / bx] <= 0) continue;
            if (make_patch(s, i, j, x, y, (double)block[x0 / bx]) != 0) {
                st = ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for its bright patches", f->path);
                break;
            }
        }
    }
    ilf_unpeek_probe(f, pix, own);
    return st;
}

ilf_status ilf_find_patches(ilf_sampler *s, ilf_error *err)
{
    const ilf *f = s->field;
    float *block = malloc((size_t)f->info.n_theta * sizeof *block);
    double size = PATCH_SIZE;
    ilf_status st = ILF_OK;

    if (!block) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for its bright patches", f->path);
    if (s->threshold <= 0) {
        double mean = 0;
        st = mean_luminance(&mean, f, err);
        s->threshold = 3 * mean; /* 0 where these probes have no light: then all that others have is excess */
    }
    for (int again = 1; again && st == ILF_OK; size *= 2) { /* coarser, until there are few enough */
        again = 0;
        s->patches.n = 0;
        for (int j = 0; j < f->info.n_v && st == ILF_OK && !again; j++)
            for (int i = 0; i < f->info.n_u && st == ILF_OK && !again; i++) {
                st = probe_patches(s, i, j, size, block, err);
                again = s->patches.n > MAX_PATCHES && size < ILF_PI / 4;
            }
    }
    free(block);
    s->unit = 0;
    for (size_t k = 0; k < s->patches.n; k++) s->unit = fmax(s->unit, (double)s->patches.p[k].excess);
    for (size_t k = 0; k < s->patches.n; k++) /* no weight is 0: a slice may see the faintest patch alone */
        s->patches.p[k].excess = (float)fmax((double)s->patches.p[k].excess / s->unit, 1e-30);
    return st;
}
