/*
 * ilf_look.c - angles, texels and their sum for the four probes around a ray, in plain C (ilf_look.h).
 *
 * Everything is computed in double: the field's texels may differ a thousandfold from one to the next, which multiplies
 * any error of position.
 */
#include "ilf_angle.h"
#include "ilf_look.h"

typedef struct vec {
    double u, v, n;
} vec;

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
static void add_probe(double sum[3], const ilf *f, const ilf_cell *cell, int k, const place *at)
{
    const unsigned char *row = cell->pix[k] + at->row;
    const double top = cell->w[k] * at->top, rest = cell->w[k] - top;

    add_row(sum, f, row, at, top);
    if (at->below == NEXT_ROW)
        add_row(sum, f, row + f->row_bytes, at, rest);
    else if (at->below != NOTHING)
        for (int c = 0; c < 3; c++) sum[c] += rest * (double)cell->probe[k]->pole[at->below == POLE_BELOW][c];
}

void ilf_look_plain(float rgb[3], const ilf *f, const ilf_cell *cell)
{
    const place at = find_place(f, (vec){cell->d[0], cell->d[1], cell->d[2]});
    double sum[3] = {0, 0, 0};

    for (int k = 0; k < 4; k++)
        if (cell->w[k] > 0) add_probe(sum, f, cell, k, &at);
    for (int c = 0; c < 3; c++) rgb[c] = (float)sum[c];
}

/* Direction from probe k to the hit, its largest coordinate brought to 1; the ray's own where the two coincide. */
static vec towards_hit(const ilf *f, const ilf_cell *cell, int k)
{
    const double qu = cell->len_u * (cell->i + (k & 1)) / f->span_u, qv = cell->len_v * (cell->j + (k >> 1)) / f->span_v;
    const vec to = {cell->h[0] - qu - qv * cell->cos_uv, cell->h[1] - qv - qu * cell->cos_uv, cell->h[2]};
    const double size = fmax(fabs(to.u), fmax(fabs(to.v), fabs(to.n)));

    if (size > 0) return (vec){to.u / size, to.v / size, to.n / size};
    return (vec){cell->d[0], cell->d[1], cell->d[2]};
}

void ilf_look_plain_depth(float rgb[3], const ilf *f, const ilf_cell *cell)
{
    double sum[3] = {0, 0, 0};

    for (int k = 0; k < 4; k++)
        if (cell->w[k] > 0) {
            const place at = find_place(f, towards_hit(f, cell, k));
            add_probe(sum, f, cell, k, &at);
        }
    for (int c = 0; c < 3; c++) rgb[c] = (float)sum[c];
}
