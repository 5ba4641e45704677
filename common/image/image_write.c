/*
 * image_write.c - writing pictures: which format, and what no format may be given; see image.h.
 */
#include <math.h>
#include <string.h>
#include <strings.h>

#include "base/outfile.h"
#include "image_internal.h"

static const float half_max = 65504; /* largest finite HALF */

static int ends_with(const char *path, const char *ending)
{
    size_t n = strlen(path), m = strlen(ending);
    return n > m && strcasecmp(path + n - m, ending) == 0;
}

/* Every value finite, and where asked within HALF's range?  The first that isn't is named. */
static int check_values(const char *path, const char *what, const float *pix, size_t stride, int channels,
                        int w, int h, int half, errmsg *e)
{
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            const float *p = pix + ((size_t)y * (size_t)w + (size_t)x) * stride;
            for (int c = 0; c < channels; c++) {
                if (!isfinite(p[c]))
                    return err_set(e, "%s: expected finite values, found %g in %s %d of pixel (%d, %d)", path,
                                   (double)p[c], what, c, x, y);
                if (half && fabsf(p[c]) > half_max)
                    return err_set(
                        e,
                        "%s: expected values up to 65504 for type half, found %g in %s %d of pixel "
                        "(%d, %d): type float holds it (--type float)",
                        path, (double)p[c], what, c, x, y);
            }
        }
    }
    return 0;
}

static int fits_half(const img *im)
{
    size_t n = (size_t)im->info.width * (size_t)im->info.height * (size_t)im->info.channels;
    for (size_t i = 0; i < n; i++)
        if (fabsf(im->pix[i]) > half_max) return 0;
    return 1;
}

int img_write(const img *im, const char *path, const img_write_opts *opts, errmsg *e)
{
    const img_info *info = &im->info;
    int exr = ends_with(path, ".exr"), png = ends_with(path, ".png");
    int hdr = strcmp(path, "-") == 0 || ends_with(path, ".hdr") || ends_with(path, ".pic");
    if (!exr && !png && !hdr) return err_set(e, "%s: expected a name that ends in .exr, .hdr or .png", path);
    if (info->channels < 1 || info->channels > 4 || !im->pix)
        return err_set(e, "%s: expected 1 to 4 channels, found %d", path, info->channels);
    if (img_check_size(path, info->width, info->height, e) < 0) return -1;

    img_write_opts given = {0};
    if (opts) given = *opts;
    else given.type = fits_half(im) ? IMG_HALF : IMG_FLOAT;
    if (given.nplanes && !exr)
        return err_set(e, "%s: expected a name that ends in .exr for extra channels", path);
    if (check_values(path, "channel", im->pix, (size_t)info->channels, info->channels, info->width,
                     info->height, exr && given.type == IMG_HALF, e) < 0)
        return -1;
    for (int i = 0; i < given.nplanes; i++) {
        const img_plane *p = &given.planes[i];
        if (check_values(path, p->name, p->pix, p->stride, 1, info->width, info->height, p->type == IMG_HALF,
                         e) < 0)
            return -1;
    }

    outfile *o;
    if (out_begin(&o, path, e) < 0) return -1;
    int rc = (exr ? img_write_exr : png ? img_write_png : img_write_hdr)(im, o, path, &given, e);
    if (rc < 0) {
        out_abort(o);
        return -1;
    }
    return out_commit(o, e);
}
