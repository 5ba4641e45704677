/*
 * ilf_draw.c - directions drawn from a slice, and their density.
 *
 * The density is that of the map's cell divided by the cell's solid angle, mixed with a little of the
 * uniform density over the hemisphere (SLICE_UNIFORM).
 */
#include "ilf_hemi.h"
#include "ilf_sampler.h"

static void from_cell(double d[3], int number, double v, double w)
{
    const double a = (double)gather((uint32_t)number) + v, b = (double)gather((uint32_t)number >> 1) + w;

    ilf_square_to_hemi(d, a * 2 / SLICE_SIDE - 1, b * 2 / SLICE_SIDE - 1);
}

static int cell_of(const double d[3])
{
    double a, b;

    ilf_hemi_to_square(&a, &b, d);
    return cell_number(clamp_cell((a + 1) * (SLICE_SIDE / 2)), clamp_cell((b + 1) * (SLICE_SIDE / 2)));
}

/* Last k with cdf[k] <= u.  Draws come in the map's order mostly: the steps from the last one are doubled,
 * then halved. */
static int search_cdf(ilf_slice *sl, double u)
{
    int lo = (double)sl->cdf[sl->last] <= u ? sl->last : 0, step = 1;

    while (lo + step < sl->cells && (double)sl->cdf[lo + step] <= u) {
        lo += step;
        step *= 2;
    }
    int hi = lo + step < sl->cells ? lo + step : sl->cells;
    while (hi - lo > 1) {
        const int mid = (lo + hi) / 2;
        if ((double)sl->cdf[mid] <= u) lo = mid;
        else hi = mid;
    }
    return sl->last = lo;
}

/* Index of a cell in the slice, or -1. */
static int search_cell(const ilf_slice *sl, int number)
{
    int lo = 0, hi = sl->cells;

    while (lo < hi) {
        const int mid = (lo + hi) / 2;
        if (sl->cell[mid] < number) lo = mid + 1;
        else hi = mid;
    }
    return lo < sl->cells && sl->cell[lo] == number ? lo : -1;
}

static double density(const ilf_slice *sl, int k)
{
    const double map = k < 0 ? 0 : ((double)sl->cdf[k + 1] - (double)sl->cdf[k]) / SLICE_OMEGA;

    return SLICE_UNIFORM / (2 * ILF_PI) + (1 - SLICE_UNIFORM) * map;
}

void ilf_sample(ilf_draw *draw, ilf_slice *sl, double u, double v, double w)
{
    int cell, k;

    if (u < SLICE_UNIFORM) {
        cell = (int)(u / SLICE_UNIFORM * SLICE_CELLS);
        if (cell >= SLICE_CELLS) cell = SLICE_CELLS - 1;
        k = search_cell(sl, cell);
    } else {
        k = search_cdf(sl, (u - SLICE_UNIFORM) / (1 - SLICE_UNIFORM));
        cell = sl->cell[k];
    }
    from_cell(draw->dir, cell, v, w);
    draw->pdf = density(sl, k);
    draw->near = k < 0 ? HUGE_VAL : (double)sl->near[k];
    draw->far = k < 0 ? HUGE_VAL : (double)sl->far[k];
    draw->expected = k < 0 ? 0 : ((double)sl->cdf[k + 1] - (double)sl->cdf[k]) * sl->total;
}

double ilf_pdf(const ilf_slice *sl, const double dir[3])
{
    const double len = sqrt(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2]);

    if (!(len > 0) || dir[2] <= 0) return 0;
    const double d[3] = {dir[0] / len, dir[1] / len, dir[2] / len};
    return density(sl, search_cell(sl, cell_of(d)));
}
