/*
 * content.c - what the page holds of one light field.
 */
#include "content.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "exr/exr_half.h"
#include "irradiance.h"
#include "programs/field_guard.h"
#include "reduce.h"

enum { LIGHT_GRID = 65, LEAST_SIDE = 4 };
#define BASE64 (4. / 3)

/* ---- sizes -------------------------------------------------------------------------------------- */

static double texel_bytes(double probes, double nt, double np)
{
    return probes * (nt * np + 2) * 6 * BASE64;
}

/* Texels of a probe such that all take at most so many bytes. */
static int choose_size(content *c, double bytes, errmsg *e)
{
    const lightfield *f = &c->field;
    double s = fmin(1, sqrt(bytes / texel_bytes(f->n, f->nt, f->np)));

    for (;; s *= .99) {
        c->nt = (int)fmax(1, f->nt * s), c->np = (int)fmax(1, f->np * s);
        if (texel_bytes(f->n, c->nt, c->np) <= bytes) break;
        if (c->nt <= LEAST_SIDE || c->np <= LEAST_SIDE)
            return err_set(e, "%s: --size-mb: expected room for its %d probes, found too little", c->name,
                           f->n);
    }
    if (c->nt < f->nt || c->np < f->np)
        cli_note("%s: probes of %d x %d texels made %d x %d to keep the page within --size-mb", c->name,
                 f->nt, f->np, c->nt, c->np);
    return 0;
}

/* ---- probes ------------------------------------------------------------------------------------- */

/* The power of two that brings the largest value just below a half's largest. */
static int scale_for(double most)
{
    int k;

    if (!(most > 0)) return 0;
    frexp(most, &k);
    k -= 16;
    return ldexp(most, -k) > 65504 ? k + 1 : k;
}

static void mean_of_row(float mean[3], const float *row, int n)
{
    double sum[3] = {0, 0, 0};

    for (int x = 0; x < 3 * n; x++) sum[x % 3] += (double)row[x];
    for (int k = 0; k < 3; k++) mean[k] = (float)(sum[k] / n);
}

/* All probes at the page's size, with the two texels more. */
static float *smaller(const content *c, errmsg *e)
{
    const lightfield *f = &c->field;
    const size_t each = ((size_t)c->nt * (size_t)c->np + 2) * 3;
    float *all = malloc((size_t)f->n * each * sizeof *all);

    if (!all) {
        err_set(e, "%s: no memory for its texels", c->name);
        return NULL;
    }
#pragma omp parallel for schedule(dynamic)
    for (int k = 0; k < f->n; k++) {
        float *to = all + (size_t)k * each;
        reduce_probe(to, c->nt, c->np, lf_texel(f, k, 0, 0), f->nt, f->np, f->polar_max);
        mean_of_row(to + each - 6, to, c->nt);
        mean_of_row(to + each - 3, to + (size_t)(c->np - 1) * (size_t)c->nt * 3, c->nt);
    }
    return all;
}

static int encode_probes(content *c, errmsg *e)
{
    const size_t n = (size_t)c->field.n * ((size_t)c->nt * (size_t)c->np + 2) * 3;
    float *all = smaller(c, e);
    double most = 0;

    if (!all) return -1;
    for (size_t k = 0; k < n; k++) most = fmax(most, fabs((double)all[k]));
    c->scale = scale_for(most);
    c->texels = malloc(n * sizeof *c->texels);
    for (size_t k = 0; c->texels && k < n; k++)
        c->texels[k] = half_from_float((float)ldexp((double)all[k], -c->scale));
    free(all);
    return c->texels ? 0 : err_set(e, "%s: no memory for its texels", c->name);
}

/* ---- lamps -------------------------------------------------------------------------------------- */

static void lamp_row(float r[VIEW_ROW], const ilf_luminaire *l, int first_mask)
{
    memset(r, 0, VIEW_ROW * sizeof *r);
    r[0] = (float)l->shape, r[1] = (float)l->far;
    for (int k = 0; k < 3; k++) {
        r[2 + k] = (float)l->centre[k], r[5 + k] = (float)l->a[k], r[8 + k] = (float)l->b[k];
        r[12 + k] = l->rgb[k];
    }
    r[11] = (float)l->radius, r[15] = (float)l->nmasks, r[20] = (float)first_mask;
    r[16] = (float)l->error_masks, r[17] = (float)l->error_interpolation;
    r[18] = (float)l->error_position, r[19] = (float)l->error_radiance;
}

/* Distance between samples when fewer of them span the same. */
static float spread(double step, int many, int few)
{
    return (float)(few > 1 ? step * (many - 1) / (few - 1) : step);
}

static void mask_row(float r[VIEW_ROW], const ilf_mask *m, const int size[2], int64_t begins)
{
    memset(r, 0, VIEW_ROW * sizeof *r);
    r[0] = (float)m->kind, r[1] = (float)m->link, r[2] = (float)m->adds, r[3] = (float)m->beta;
    for (int k = 0; k < 3; k++) r[4 + k] = (float)m->plane[k];
    for (int k = 0; k < 6; k++) r[7 + k] = (float)m->coef[k];
    r[20] = (float)begins;
    if (!m->grid) return;
    r[13] = (float)size[0], r[14] = (float)size[1], r[15] = (float)m->nz;
    r[16] = (float)m->x0, r[17] = (float)m->y0;
    r[18] = spread(m->dx, m->nx, size[0]), r[19] = spread(m->dy, m->ny, size[1]);
}

static int64_t samples_of(int size[2], const ilf_mask *m, double factor)
{
    size[0] = size[1] = 0;
    if (!m->grid) return 0;
    reduce_size(size, m, factor);
    return (int64_t)size[0] * size[1] * (m->nz > 1 ? m->nz : 1);
}

static int64_t all_samples(const content *c, double factor)
{
    int64_t n = 0;
    int size[2];

    for (int i = 0; i < c->n_lamps; i++)
        for (int k = 0; k < c->lamps[i].nmasks; k++) n += samples_of(size, &c->lamps[i].masks[k], factor);
    return n;
}

/* Pictures of masks may take half of the room. */
static int choose_pictures(content *c, double bytes, errmsg *e)
{
    double factor = 1;

    while (((double)all_samples(c, factor) * 4 * BASE64 > bytes / 2 || all_samples(c, factor) > 1 << 24) &&
           factor < 1000)
        factor *= 1.1;
    c->picture_factor = factor, c->n_pictures = all_samples(c, factor);
    if (factor >= 1000)
        return err_set(e, "%s: --size-mb: expected room for what hides its lamps, found too little", c->name);
    if (factor > 1)
        cli_note(
            "%s: pictures of what hides its lamps made %.3g times coarser to keep the page within --size-mb",
            c->name, factor);
    return 0;
}

static void fill_lamps(content *c)
{
    int64_t begins = 0;
    int mask = 0, size[2];

    for (int i = 0; i < c->n_lamps; i++) {
        const ilf_luminaire *l = &c->lamps[i];
        lamp_row(c->lamp_rows + VIEW_ROW * i, l, mask);
        for (int k = 0; k < l->nmasks; k++, mask++) {
            const int64_t n = samples_of(size, &l->masks[k], c->picture_factor);
            mask_row(c->mask_rows + VIEW_ROW * mask, &l->masks[k], size, begins);
            if (n) reduce_picture(c->pictures + begins, size, &l->masks[k]);
            begins += n;
        }
    }
}

static int encode_lamps(content *c, double bytes, errmsg *e)
{
    for (int i = 0; i < c->n_lamps; i++) c->n_masks += c->lamps[i].nmasks;
    if (choose_pictures(c, bytes, e)) return -1;
    c->lamp_rows = calloc((size_t)c->n_lamps + 1, VIEW_ROW * sizeof(float));
    c->mask_rows = calloc((size_t)c->n_masks + 1, VIEW_ROW * sizeof(float));
    c->pictures = malloc((size_t)(c->n_pictures + 1) * sizeof(float));
    if (!c->lamp_rows || !c->mask_rows || !c->pictures)
        return err_set(e, "%s: no memory for its lamps", c->name);
    fill_lamps(c);
    return 0;
}

/* ---- light on the plane ---------------------------------------------------------------------------- */

static int points(double length, double longest)
{
    return (int)fmax(2, ceil(LIGHT_GRID * length / longest));
}

static int light_plane(content *c, errmsg *e)
{
    const lightfield *f = &c->field;

    c->irradiance = malloc((size_t)f->n * 3 * sizeof(float));
    if (c->n_lamps) c->ex = points(f->len_u, f->size), c->ey = points(f->len_v, f->size);
    c->lamp_light = calloc((size_t)c->ex * (size_t)c->ey * 3 + 1, sizeof(float));
    if (!c->irradiance || !c->lamp_light)
        return err_set(e, "%s: no memory for the light on its plane", c->name);
    for (int k = 0; k < f->n; k++) {
        double rgb[3];
        irradiance_probe(rgb, f, k);
        for (int i = 0; i < 3; i++) c->irradiance[3 * k + i] = (float)rgb[i];
    }
    irradiance_lamps(c->lamp_light, c->ex, c->ey, f, c->lamps, c->n_lamps);
    return 0;
}

/* ---- geometry ----------------------------------------------------------------------------------------- */

static int offer_surfaces(content *c, const surface_given *given, errmsg *e)
{
    surface box;
    double mismatch;
    const int several = c->field.n > 1;

    if (given) surface_place(&c->surfaces[c->n_surfaces++], given, &c->field.frame);
    if (several && surface_guess(&box, &mismatch, &c->field, e)) return -1;
    if (several) c->surfaces[c->n_surfaces++] = box;
    surface_sphere(&c->surfaces[c->n_surfaces++], several ? &box : NULL, &c->field);
    if (!given || given->kind != SURFACE_FAR) surface_far(&c->surfaces[c->n_surfaces++]);
    if (given) return 0;
    if (several)
        cli_note("%s: the room is taken for a %s: probes' pictures of the same point of it differ by %.2g %% "
                 "(mean); "
                 "--geometry names another",
                 c->name, box.words, 100 * expm1(mismatch));
    else cli_note("%s: the room is taken for a %s; --geometry names another", c->name, c->surfaces[0].words);
    return 0;
}

/* ---- all of it ------------------------------------------------------------------------------------------- */

int content_read(content *c, const char *path, double bytes, const surface_given *given, errmsg *e)
{
    ilf_error err;

    memset(c, 0, sizeof *c);
    c->name = path;
    if (lf_read(&c->field, path, e)) return -1;
    if (field_open(&c->file, path, &err) != ILF_OK) return err_set(e, "%s", err.text);
    c->lamps = ilf_get_luminaires(&c->n_lamps, c->file);
    if (encode_lamps(c, bytes, e) || light_plane(c, e)) return -1;
    const double rest = bytes - BASE64 * 4 *
                                    ((double)c->n_pictures + VIEW_ROW * (c->n_lamps + c->n_masks) +
                                     3. * c->ex * c->ey + 3. * c->field.n);
    if (choose_size(c, rest, e) || encode_probes(c, e) || offer_surfaces(c, given, e)) return -1;
    return ilf_check_unchanged(c->file, &err) != ILF_OK ? err_set(e, "%s", err.text) : 0;
}

void content_free(content *c)
{
    free(c->texels), free(c->lamp_rows), free(c->mask_rows), free(c->pictures);
    free(c->irradiance), free(c->lamp_light);
    lf_free(&c->field);
    field_close(c->file);
    memset(c, 0, sizeof *c);
}
