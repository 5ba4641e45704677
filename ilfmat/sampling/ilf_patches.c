/*
 * ilf_patches.c - find what is bright in a light field.
 *
 * Each probe is looked through once, and texels whose luminance exceeds the threshold are gathered into
 * patches of about a degree, each kept as a ball in space (ilf_patch.c).  The list is not changed any more
 * once it is open.
 */
#include <stdlib.h>

#include "ilf_sampler.h"

/* Angular size of a patch that is aimed at, and how many patches are too many. */
#define PATCH_SIZE  (1.0 * ILF_PI / 180)
#define MAX_PATCHES 36000

/* Bright is what exceeds the mean by this factor: between 1.5 and 10 it makes no difference to the noise (a
 * prototype's measurement).  The mean is of so many probes in either direction at most. */
#define BRIGHT      3
#define MEAN_PROBES 6

/* A sampled rectangle is at least so many cubes of space across. */
#define CUBES_ACROSS 24

/* Width of a cell of the map, radians: sqrt(2 pi) / 256. */
#define CELL_WIDTH 0.0098

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

static int rows_to(const ilf *f, double polar)
{
    const double edge = fmin(f->info.polar_valid, polar) * f->info.n_phi / f->info.polar_max - 0.5;
    const int rows = (int)ceil(edge) + 1;

    return rows < 1 ? 1 : rows > f->info.n_phi ? f->info.n_phi : rows;
}

int ilf_patch_rows(const ilf_patches *pl)
{
    return rows_to(pl->field, pl->mode == ILF_DEPTH ? ILF_PI : ILF_PI / 2);
}

/* Mean over the hemisphere of what a few probes spread over the grid (a threshold needs no more) have of
 * luminance above 0: texels below it, where a background was subtracted too far, say nothing of where the
 * bright ones begin. */
static ilf_status mean_luminance(double *mean, const ilf *f, ilf_error *err)
{
    const int most = MEAN_PROBES, rows = rows_to(f, ILF_PI / 2), n_u = f->info.n_u, n_v = f->info.n_v;
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

/* What the lamps that were taken out add to that mean: as much as the probes saw of each. */
static double lamps_luminance(const ilf *f)
{
    const int n_u = f->info.n_u, n_v = f->info.n_v;
    double sum = 0;

    for (int k = 0; k < f->n_lamps; k++)
        for (int m = 0; m < n_u * n_v; m++) {
            const ilf_luminaire *l = &f->lamps[k];
            const double o[3] = {n_u > 1 ? f->frame.len_u * (m % n_u) / (n_u - 1) : f->frame.len_u / 2,
                                 n_v > 1 ? f->frame.len_v * (m / n_u) / (n_v - 1) : f->frame.len_v / 2, 0};
            const double part = l->seen ? fmax(0, (double)l->seen[m]) : 1;
            sum += part * fmax(0, ilf_luminance(l->rgb)) * fmin(ilf_luminaire_omega(l, o), 2 * ILF_PI);
        }
    return sum / (2 * ILF_PI * n_u * n_v);
}

/* ---- list ----------------------------------------------------------------------------------- */

/* Largest excess in each block of bx texels of rows [y0, y1); 1 if there is any. */
static int band_excess(float *block, int bx, int y0, int y1, const ilf_patches *pl, const unsigned char *pix)
{
    const ilf *f = pl->field;
    int any = 0;

    for (int y = y0; y < y1; y++) {
        const unsigned char *row = pix + (size_t)y * f->row_bytes;

        if ((double)row_bound(f, row) <= pl->threshold)
            continue; /* luminance is at most the largest channel */
        if (!any) memset(block, 0, (size_t)((f->info.n_theta + bx - 1) / bx) * sizeof *block);
        any = 1;
        for (int x = 0; x < f->info.n_theta; x++) {
            const float over = (float)(texel_luminance(f, row, x) - pl->threshold);
            if (over > block[x / bx]) block[x / bx] = over;
        }
    }
    return any;
}

static ilf_status probe_patches(ilf_patches *pl, int i, int j, double size, float *block, ilf_error *err)
{
    const ilf *f = pl->field;
    const double dt = 2 * ILF_PI / f->info.n_theta, dp = f->info.polar_max / f->info.n_phi;
    const int rows = ilf_patch_rows(pl), by = dp >= size ? 1 : (int)fmin(size / dp + 0.5, rows);
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

        if (!band_excess(block, bx, y0, y1, pl, pix)) continue;
        for (int x0 = 0; x0 < f->info.n_theta; x0 += bx) {
            const int x[2] = {x0, x0 + bx < f->info.n_theta ? x0 + bx : f->info.n_theta}, y[2] = {y0, y1};

            if (block[x0 / bx] <= 0) continue;
            if (ilf_make_patch(pl, i, j, x, y, (double)block[x0 / bx]) != 0) {
                st = ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for its bright patches", f->path);
                break;
            }
        }
    }
    ilf_unpeek_probe(f, pix, own);
    return st;
}

/* The patches of all probes, coarser until there are few enough. */
static ilf_status list_patches(ilf_patches *pl, ilf_error *err)
{
    const ilf *f = pl->field;
    float *block = malloc((size_t)f->info.n_theta * sizeof *block);
    ilf_status st = ILF_OK;
    int again = 1;

    if (!block) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for its bright patches", f->path);
    for (double size = PATCH_SIZE; again && st == ILF_OK; size *= 2) {
        again = 0;
        pl->n = 0;
        for (int j = 0; j < f->info.n_v && st == ILF_OK && !again; j++)
            for (int i = 0; i < f->info.n_u && st == ILF_OK && !again; i++) {
                st = probe_patches(pl, i, j, size, block, err);
                again = pl->n > MAX_PATCHES && size < ILF_PI / 4;
            }
    }
    free(block);
    pl->unit = 0;
    for (size_t k = 0; k < pl->n; k++) pl->unit = fmax(pl->unit, (double)pl->p[k].excess);
    for (size_t k = 0; k < pl->n; k++)
        pl->p[k].excess = (float)fmax((double)pl->p[k].excess / pl->unit, LEAST_WEIGHT);
    return st;
}

/* ---- opening ---------------------------------------------------------------------------------- */

/* The probes' pitch, below which the field does not change; but small enough that a lamp moves by no more
 * than about a cell of the map from the cube's one side to the other. */
static double cube_edge(const ilf *f, const ilf_frame *frame)
{
    const int n_u = f->info.n_u - 1, n_v = f->info.n_v - 1;

    return sqrt(frame->len_u / (n_u > CUBES_ACROSS ? n_u : CUBES_ACROSS)) *
           sqrt(frame->len_v / (n_v > CUBES_ACROSS ? n_v : CUBES_ACROSS));
}

static int by_size(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* One probe's rectangle has no meaning: it holds everywhere.  What matters is how far away its light is. */
static ilf_status cube_of_one_probe(ilf_patches *pl, ilf_error *err)
{
    const float u = (float)pl->frame.len_u / 2, v = (float)pl->frame.len_v / 2; /* where it stands */
    float *far = malloc(pl->n * sizeof *far);

    if (!far) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for sampling", pl->field->path);
    for (size_t k = 0; k < pl->n; k++) {
        const patch *p = &pl->p[k];
        far[k] = sqrtf((p->u - u) * (p->u - u) + (p->v - v) * (p->v - v) + p->n * p->n);
    }
    qsort(far, pl->n, sizeof *far, by_size);
    const double middle = (double)far[pl->n / 2];
    if (middle > 0 && middle < ilf_far_away(&pl->frame) / 2) pl->cube = middle * CELL_WIDTH;
    free(far);
    return ILF_OK;
}

void ilf_patches_close(ilf_patches *pl)
{
    if (!pl) return;
    free(pl->p);
    free(pl->cell_dir);
    free(pl->mark_dir);
    free(pl->balls);
    free(pl);
}

static ilf_status fill(ilf_patches *pl, const ilf_patches_spec *spec, ilf_error *err)
{
    ilf_status st = ILF_OK;

    ilf_read_ahead(pl->field);
    pl->cell_dir = ilf_cell_centres(SLICE_SIDE);
    pl->mark_dir = ilf_cell_centres(MARK_SIDE);
    if (!pl->cell_dir || !pl->mark_dir)
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for sampling", pl->field->path);
    if (pl->threshold <= 0) {
        double mean = 0;
        st = mean_luminance(&mean, pl->field, err);
        pl->threshold =
            BRIGHT *
            (mean +
             lamps_luminance(pl->field)); /* 0 where these probes have no light: what others have is excess */
    }
    if (st == ILF_OK) st = list_patches(pl, err);
    if (st == ILF_OK && pl->n && spec->cube <= 0 && pl->field->info.n_u * pl->field->info.n_v == 1)
        st = cube_of_one_probe(pl, err);
    if (st == ILF_OK && ilf_patches_count(pl) && spec->n_balls)
        st = ilf_glint_balls_open(&pl->balls, pl, spec->balls, spec->n_balls, err);
    pl->hit = NULL;
    pl->context = NULL;
    return st;
}

ilf_status ilf_patches_open(ilf_patches **patches, const ilf *field, const ilf_frame *frame,
                            const ilf_patches_spec *spec, ilf_error *err)
{
    ilf_status st = ilf_check_frame(field, frame, err);
    ilf_patches *pl = st == ILF_OK ? calloc(1, sizeof *pl) : NULL;

    if (st != ILF_OK) return st;
    if (!pl) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for sampling", field->path);
    pl->field = field;
    pl->frame = *frame;
    pl->mode = spec->mode;
    pl->hit = spec->hit;
    pl->context = spec->context;
    pl->threshold = spec->threshold;
    pl->cube = spec->cube > 0 ? spec->cube : cube_edge(field, frame);
    st = fill(pl, spec, err);
    if (st != ILF_OK) {
        ilf_patches_close(pl);
        return st;
    }
    *patches = pl;
    return ILF_OK;
}

double ilf_patches_threshold(const ilf_patches *pl)
{
    return pl->threshold;
}

int64_t ilf_patches_count(const ilf_patches *pl)
{
    return (int64_t)pl->n + pl->field->n_lamps;
}
