/* input.c - see input.h. */
#include "input.h"

/* Mask: white (over half of its scale) keeps, black discards. */
static int fold_mask(img *im, const char *path, errmsg *e)
{
    img m;
    if (img_load(&m, path, e)) return -1;
    const int64_t w = m.info.width, h = m.info.height, W = im->info.width, H = im->info.height;
    if (w > W || h > H || w * H != h * W) {
        img_free(&m);
        return err_set(
            e,
            "%s: expected a mask of %lld x %lld pixels, as the picture, or smaller with its aspect, "
            "found %lld x %lld",
            path, (long long)W, (long long)H, (long long)w, (long long)h);
    }
    float level = (float)(m.info.coded ? m.info.max_code / 2 : 0.5);
    for (int64_t y = 0; y < H; y++)
        for (int64_t x = 0; x < W; x++) {
            int64_t at = (y * h / H * w + x * w / W) * m.info.channels;
            if (!(m.pix[at] >= level)) im->pix[4 * (y * W + x) + 3] = 0;
        }
    img_free(&m);
    return 0;
}

int input_load(img *im, int *all_good, const settings *s, errmsg *e)
{
    img a, b;
    const img_open_opts how = {.layer = s->layer};
    if (img_load_as(&a, s->in, &how, e)) return -1;
    img_linearise_srgb(&a);
    if (img_alloc(&b, a.info.width, a.info.height, 4, e)) {
        img_free(&a);
        return -1;
    }
    b.info.orientation = a.info.orientation, b.info.pano = a.info.pano;
    b.info.f_number = a.info.f_number, b.info.exposure_s = a.info.exposure_s, b.info.iso = a.info.iso;
    int ch = a.info.channels;
    size_t n = (size_t)a.info.width * (size_t)a.info.height;
    /* alpha of a coded picture is a code; of a radiometric one a share */
    float alpha_scale = a.info.coded && a.info.max_code > 0 ? (float)(1 / a.info.max_code) : 1;
    int bad = s->mask != NULL;
#pragma omp parallel for schedule(static) reduction(| : bad)
    for (size_t i = 0; i < n; i++) {
        const float *p = a.pix + i * (size_t)ch;
        float *q = b.pix + 4 * i;
        q[0] = p[0], q[1] = ch >= 3 ? p[1] : p[0], q[2] = ch >= 3 ? p[2] : p[0];
        q[3] = ch == 2 || ch == 4 ? p[ch - 1] * alpha_scale : 1;
        float sum = q[0] + q[1] + q[2];
        bad |= !(sum - sum == 0) | (q[3] != 1);
    }
    img_free(&a);
    if (s->mask && fold_mask(&b, s->mask, e)) {
        img_free(&b);
        return -1;
    }
    *im = b;
    *all_good = !bad;
    return 0;
}
