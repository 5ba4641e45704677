/* fuzz_ilf.c - a light field file: header, table of tiles, tiles, lookups, sampling. */
#include <math.h>

#include "fuzz.h"
#include "ilf.h"

static void look_up(const ilf *field)
{
    static const double dirs[][3] = {{0, 0, 1}, {1, 0, 1e-12}, {-1, -1e-300, 1e-9},
                                     {1, 2, 3}, {-1, 0, .5},   {0, 0, -1}};
    const ilf_frame *f = ilf_get_frame(field);
    ilf_error err;

    for (size_t k = 0; k < sizeof dirs / sizeof *dirs; k++) {
        const double *a = dirs[k], reach = f->len_u + f->len_v;
        double d[3], h[3], below[3];
        float rgb[3];

        for (int c = 0; c < 3; c++) {
            d[c] = a[0] * f->u[c] + a[1] * f->v[c] + a[2] * f->n[c];
            h[c] = f->origin[c] + .3 * f->len_u * f->u[c] + .6 * f->len_v * f->v[c] + d[c] * reach;
            below[c] = f->origin[c] - f->n[c];
        }
        for (int m = 0; m < 6; m++) {
            const double *hit = m % 3 == 0 ? h : m % 3 == 1 ? NULL : f->origin;
            const ilf_status st =
                ilf_eval(rgb, field, f, m < 3 ? h : below, d, hit, m < 3 ? ILF_DEPTH : ILF_NO_DEPTH, &err);
            if (st != ILF_OK) {
                one_line(err.text);
                continue;
            }
            for (int c = 0; c < 3; c++) HOLDS(isfinite(rgb[c]));
        }
    }
}

/* Rays that meet the lamps, from the plane and from beside it, with all that stands between. */
static void look_at_lamps(const ilf *field)
{
    const ilf_frame *f = ilf_get_frame(field);
    int n;
    const ilf_luminaire *l = ilf_get_luminaires(&n, field);

    for (int i = 0; i < n && i < 16; i++)
        for (int k = 0; k < 4; k++) {
            const double from[3] = {.4 * f->len_u, k & 1 ? -1e3 : .1, k & 2 ? .5 * l[i].centre[2] : 0};
            double o[3], h[3], d[3];
            float rgb[3];
            ilf_error err;
            for (int c = 0; c < 3; c++) {
                o[c] = f->origin[c] + from[0] * f->u[c] + from[1] * f->v[c] + from[2] * f->n[c];
                h[c] = f->origin[c] + 2 * (l[i].centre[0] * f->u[c] + l[i].centre[1] * f->v[c]) +
                       2 * l[i].centre[2] * f->n[c];
                d[c] = (h[c] - f->origin[c]) / 2 - (o[c] - f->origin[c]);
            }
            if (ilf_eval(rgb, field, f, o, d, h, ILF_DEPTH, &err) != ILF_OK) one_line(err.text);
            else
                for (int c = 0; c < 3; c++) HOLDS(isfinite(rgb[c]));
        }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_file file = file_of(data, size);
    ilf *field = NULL;
    ilf_error err;
    const ilf_status opened = ilf_open(&field, file.path, &err);

    if (opened != ILF_OK) {
        HOLDS(field == NULL);
        one_line(err.text);
    } else {
        const ilf_info *i = ilf_get_info(field);
        HOLDS(i->n_u >= 1 && i->n_v >= 1 && i->n_theta >= 1 && i->n_phi >= 1);
        HOLDS(i->polar_max > 0 && i->polar_max < 3.1416 && i->polar_valid > 0 &&
              i->polar_valid <= i->polar_max);
        if ((int64_t)i->n_theta * i->n_phi <= 1 << 16) {
            float *rgb = malloc((size_t)i->n_theta * (size_t)i->n_phi * 3 * sizeof *rgb);
            HOLDS(rgb != NULL);
            for (int j = 0; j < i->n_v && j < 3; j++)
                for (int k = 0; k < i->n_u && k < 3; k++) {
                    if (ilf_read_probe(rgb, field, k, j, &err) != ILF_OK) {
                        one_line(err.text);
                        continue;
                    }
                    for (int t = 0; t < i->n_theta * i->n_phi * 3; t++) HOLDS(isfinite(rgb[t]));
                }
            free(rgb);
            look_up(field);
            look_at_lamps(field);
            if ((int64_t)i->n_u * i->n_v <= 64) {
                const ilf_patches_spec spec = {.mode = ILF_DEPTH};
                ilf_patches *bright = NULL;
                ilf_sampler *s = NULL;
                ilf_slice *slice = NULL;
                if (ilf_patches_open(&bright, field, ilf_get_frame(field), &spec, &err) != ILF_OK) {
                    HOLDS(bright == NULL);
                    one_line(err.text);
                } else if (ilf_sampler_open(&s, bright, &err) != ILF_OK) one_line(err.text);
                else if (ilf_sampler_slice(&slice, s, ilf_get_frame(field)->origin, &err) != ILF_OK)
                    one_line(err.text);
                else if (slice) {
                    ilf_draw draw;
                    ilf_sample(&draw, slice, .3, .5, .7);
                    HOLDS(isfinite(draw.pdf) && draw.pdf >= 0);
                }
                ilf_sampler_close(s);
                ilf_patches_close(bright);
            }
        }
        ilf_close(field);
    }
    close(file.fd);
    return 0;
}
