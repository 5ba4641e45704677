/*
 * ilfinfo.c - what is in an incident light field: header, plane, range of values, mosaic picture.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "field_guard.h"
#include "ilf.h"
#include "image/image.h"
#include "lamp_words.h"
#include "shrink_words.h"

#define PI 3.14159265358979323846

static int header_only, shrink, montage_size = 1600;
static double exposure_stops;
static const char *montage;

static const cli_opt options[] = {
    {"header", 0, CLI_FLAG, &header_only, NULL, NULL, "print the header only; no probe is read"},
    {"shrink", 0, CLI_FLAG, &shrink, NULL, NULL,
     "say what the file would shrink to, from a few of its probes"},
    {"montage", 0, CLI_STRING, &montage, NULL, "FILE.png",
     "write the mosaic of all probes, probe (0,0) top left"},
    {"size", 0, CLI_INT, &montage_size, NULL, "PIXELS", "longest side of the mosaic (default 1600)"},
    {"exposure", 0, CLI_DOUBLE, &exposure_stops, NULL, "STOPS",
     "brighten the mosaic (default 0: 98 % of its pixels are below white)"},
    {0}};

static const cli_prog prog = {
    "ilfinfo",
    "FILE",
    "Describe an incident light field.",
    options,
    "Radiance is in W/sr/m^2; luminance is 179 (0.265 R + 0.670 G + 0.065 B) cd/m^2.\n"
    "Of a file of version 2 the lamps come after the header, and the values are what is left in the "
    "probes.\n",
    NULL};

/* Radiance's luminance of a colour, without the 179 lm/W. */
static double bright(const float *c)
{
    return 0.265 * (double)c[0] + 0.670 * (double)c[1] + 0.065 * (double)c[2];
}

/* ---- values --------------------------------------------------------------------------------- */

typedef struct range {
    double min[3], max[3], sum[3]; /* sum of radiance times solid angle, over all probes */
    double peak;
    int peak_i, peak_j, peak_x, peak_y;
    int64_t negative;
} range;

static void take_probe(range *r, const float *rgb, const ilf_info *in, int i, int j)
{
    for (int y = 0; y < in->n_phi; y++) {
        const double lo = y * in->polar_max / in->n_phi, hi = (y + 1) * in->polar_max / in->n_phi;
        const double omega = (cos(lo) - cos(hi)) * 2 * PI / in->n_theta;

        for (int x = 0; x < in->n_theta; x++, rgb += 3) {
            for (int c = 0; c < 3; c++) {
                const double v = (double)rgb[c];
                r->min[c] = fmin(r->min[c], v);
                r->max[c] = fmax(r->max[c], v);
                r->sum[c] += omega * v;
                r->negative += v < 0;
            }
            const double b = bright(rgb);
            if (b > r->peak) {
                r->peak = b;
                r->peak_i = i, r->peak_j = j, r->peak_x = x, r->peak_y = y;
            }
        }
    }
}

/* ---- mosaic --------------------------------------------------------------------------------- */

/* Average the probe into its cell of w x h pixels of the mosaic; each pixel is the mean of the texels
 * that it covers, or the nearest texel where the cell is larger than the probe. */
static void paste(img *im, const float *rgb, const ilf_info *in, int i, int j, int w, int h)
{
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            const int x0 = (int)((int64_t)x * in->n_theta / w), y0 = (int)((int64_t)y * in->n_phi / h);
            int x1 = (int)((int64_t)(x + 1) * in->n_theta / w), y1 = (int)((int64_t)(y + 1) * in->n_phi / h);
            double sum[3] = {0, 0, 0};

            if (x1 <= x0) x1 = x0 + 1;
            if (y1 <= y0) y1 = y0 + 1;
            for (int ty = y0; ty < y1; ty++)
                for (int tx = x0; tx < x1; tx++)
                    for (int c = 0; c < 3; c++)
                        sum[c] +=
                            (double)rgb[((size_t)ty * (size_t)in->n_theta + (size_t)tx) * 3 + (size_t)c];
            float *to = im->pix + ((size_t)(j * h + y) * (size_t)im->info.width + (size_t)(i * w + x)) * 3;
            for (int c = 0; c < 3; c++) to[c] = (float)(sum[c] / ((double)(x1 - x0) * (y1 - y0)));
        }
}

static int ascending(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

static void write_montage(img *im)
{
    const size_t n = (size_t)im->info.width * (size_t)im->info.height;
    float *level = malloc(n * sizeof *level);
    errmsg err;

    if (!level) cli_fail(CLI_FAILED, "%s: no memory", montage);
    for (size_t k = 0; k < n; k++) level[k] = (float)bright(im->pix + 3 * k);
    qsort(level, n, sizeof *level, ascending);
    double white = (double)level[(size_t)(0.98 * (double)(n - 1))];
    if (white <= 0) white = (double)level[n - 1];
    free(level);
    const double gain = white > 0 ? exp2(exposure_stops) / white : 1;
    for (size_t k = 0; k < 3 * n; k++) im->pix[k] = (float)fmin(fmax((double)im->pix[k] * gain, 0), 1);
    if (img_write(im, montage, NULL, &err) != 0) cli_fail(CLI_FAILED, "%s", err.text);
    img_free(im);
}

/* Size of a probe's cell in the mosaic. */
static int cell(int texels, int probes, double scale)
{
    const int n = (int)(texels * scale + 0.5);

    return n < 1 ? 1 : probes > IMG_MAX_SIDE / n ? 1 : n;
}

/* ---- words ---------------------------------------------------------------------------------- */

static void print_header(const char *path, const ilf *field)
{
    const ilf_info *in = ilf_get_info(field);
    const ilf_frame *f = ilf_get_frame(field);

    printf("file          %s\n", path);
    printf("format        incident light field, version %d\n", in->version);
    printf("grid          %d x %d probes (u x v)\n", in->n_u, in->n_v);
    printf("probe         %d x %d texels (theta x phi), %s, compression %s\n", in->n_theta, in->n_phi,
           in->type == ILF_HALF ? "half" : "float", in->compression);
    printf("origin        %.9g %.9g %.9g\n", (double)in->origin[0], (double)in->origin[1],
           (double)in->origin[2]);
    printf("U             %.9g %.9g %.9g\n", (double)in->U[0], (double)in->U[1], (double)in->U[2]);
    printf("V             %.9g %.9g %.9g\n", (double)in->V[0], (double)in->V[1], (double)in->V[2]);
    printf("normal        %.9g %.9g %.9g\n", f->n[0], f->n[1], f->n[2]);
    printf("pitch         %.6g x %.6g\n", in->n_u > 1 ? f->len_u / (in->n_u - 1) : f->len_u,
           in->n_v > 1 ? f->len_v / (in->n_v - 1) : f->len_v);
    printf("polar max     %.6g degrees\n", in->polar_max * 180 / PI);
    printf("polar valid   %.6g degrees\n", in->polar_valid * 180 / PI);
    printf("interleaved   %s\n", in->interleaved                   ? "yes, as a second part"
                                 : strcmp(in->compression, "none") ? "when decoded"
                                                                   : "no");
    printf("file size     %.1f MB\n", (double)in->file_bytes * 1e-6);
    print_lamps(field);
}

static void print_values(const range *r, const ilf *field)
{
    static const char names[] = "RGB";
    const ilf_info *in = ilf_get_info(field);
    const double omega = 2 * PI * (1 - cos(in->polar_max)) * in->n_u * in->n_v;
    const int64_t all = (int64_t)3 * in->n_theta * in->n_phi * in->n_u * in->n_v;
    ilf_usage use;

    for (int c = 0; c < 3; c++)
        printf("radiance %c    min %.6g, max %.6g, mean over solid angle %.6g\n", names[c], r->min[c],
               r->max[c], r->sum[c] / omega);
    printf("brightest     probe (%d,%d), theta %.4g, phi %.4g degrees: %.6g cd/m^2\n", r->peak_i, r->peak_j,
           (r->peak_x + 0.5) * 360 / in->n_theta - 180,
           (r->peak_y + 0.5) * in->polar_max * 180 / PI / in->n_phi, 179 * r->peak);
    if (r->negative)
        printf("negative      %lld of %lld values (%.2g %%), down to %.6g\n", (long long)r->negative,
               (long long)all, 100 * (double)r->negative / (double)all,
               fmin(fmin(r->min[0], r->min[1]), r->min[2]));
    ilf_get_usage(&use, field);
    printf("read          %lld of %lld probes, %.1f MB in place, %.1f MB decoded\n", (long long)use.probes,
           (long long)in->n_u * in->n_v, (double)use.mapped_bytes * 1e-6, (double)use.decoded_bytes * 1e-6);
}

int main(int argc, char **argv)
{
    const int n = cli_parse(&prog, argc, argv);
    range r = {{HUGE_VAL, HUGE_VAL, HUGE_VAL},
               {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL},
               {0, 0, 0},
               -HUGE_VAL,
               0,
               0,
               0,
               0,
               0};
    ilf_error err;
    errmsg words;
    img im = {0};
    int w = 0, h = 0;
    ilf *field;

    if (n != 1) cli_fail(CLI_USAGE, "expected one light field, found %d", n);
    if (montage_size < 1 || montage_size > 16384)
        cli_fail(CLI_USAGE, "--size: expected 1 to 16384 pixels, found %d", montage_size);
    if (montage && header_only) cli_fail(CLI_USAGE, "--header reads no probe, --montage needs them all");
    if (field_open(&field, argv[1], &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    const ilf_info *in = ilf_get_info(field);
    print_header(argv[1], field);
    if (shrink) print_shrink(field);
    if (header_only) {
        field_close(field);
        return cli_end(CLI_OK);
    }

    if (montage) {
        const int64_t full_w = (int64_t)in->n_u * in->n_theta, full_h = (int64_t)in->n_v * in->n_phi;
        const double scale = fmin(1, montage_size / (double)(full_w > full_h ? full_w : full_h));

        w = cell(in->n_theta, in->n_u, scale), h = cell(in->n_phi, in->n_v, scale);
        if (img_alloc(&im, w * in->n_u, h * in->n_v, 3, &words) != 0)
            cli_fail(CLI_FAILED, "%s: %s", montage, words.text);
    }
    float *rgb = malloc((size_t)in->n_theta * (size_t)in->n_phi * 3 * sizeof *rgb);
    if (!rgb) cli_fail(CLI_FAILED, "%s: no memory for a probe", argv[1]);
    for (int j = 0; j < in->n_v; j++)
        for (int i = 0; i < in->n_u; i++) {
            if (ilf_read_probe(rgb, field, i, j, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
            take_probe(&r, rgb, in, i, j);
            if (montage) paste(&im, rgb, in, i, j, w, h);
            cli_progress("reading probes", (double)j * in->n_u + i + 1, (double)in->n_u * in->n_v);
        }
    free(rgb);
    if (ilf_check_unchanged(field, &err) != ILF_OK) cli_fail(CLI_FAILED, "%s", err.text);
    print_values(&r, field);
    if (montage) write_montage(&im);
    field_close(field);
    return cli_end(CLI_OK);
}
