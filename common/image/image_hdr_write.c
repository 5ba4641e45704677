/*
 * image_hdr_write.c - writing Radiance pictures: RGBE in new run lengths, "-Y H +X W".
 *
 * Codes are cut off, not rounded, because a byte c is read back as c + 1/2.  Negative values have
 * no code and become 0, as in Radiance; alpha is left out; grey becomes equal R, G, B.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "image_internal.h"

enum { RLE_MIN = 8, RLE_MAX = 32767, RUN_MIN = 4, RUN_MAX = 127, COPY_MAX = 128 };

static void to_rgbe(unsigned char out[4], const float rgb[3])
{
    float top = fmaxf(rgb[0], fmaxf(rgb[1], rgb[2]));
    memset(out, 0, 4);
    if (!(top > 1e-32f)) return;
    int exponent;
    frexpf(top, &exponent);
    for (int i = 0; i < 3; i++)
        if (rgb[i] > 0) out[i] = (unsigned char)ldexpf(rgb[i], 8 - exponent);
    out[3] = (unsigned char)(exponent + 128);
}

/* How many equal bytes begin at p. */
static int run_at(const unsigned char *p, int left)
{
    int n = 1;
    while (n < left && n < RUN_MAX && p[n] == p[0]) n++;
    return n;
}

static void put_component(FILE *f, const unsigned char *p, int n)
{
    for (int x = 0; x < n;) {
        int run = run_at(p + x, n - x);
        if (run >= RUN_MIN) {
            putc_unlocked(128 + run, f);
            putc_unlocked(p[x], f);
            x += run;
            continue;
        }
        int copy = 0; /* up to the next run that is worth it */
        while (x + copy < n && copy < COPY_MAX) {
            int next = run_at(p + x + copy, n - x - copy);
            if (next >= RUN_MIN) break;
            copy += next;
        }
        if (copy > COPY_MAX) copy = COPY_MAX;
        putc_unlocked(copy, f);
        fwrite(p + x, 1, (size_t)copy, f);
        x += copy;
    }
}

static void put_line_of_text(FILE *f, const char *name, const char *text)
{
    if (name) fprintf(f, "%s=", name);
    for (; *text; text++) putc(*text == '\n' || *text == '\r' ? ' ' : *text, f);
    putc('\n', f);
}

static void put_attr(FILE *f, const img_attr *a)
{
    int n = a->kind == IMG_ATTR_V3F ? 3 : 1;
    if (a->kind == IMG_ATTR_STRING) {
        put_line_of_text(f, a->name, a->s);
        return;
    }
    int chroma = a->kind == IMG_ATTR_CHROMATICITIES;
    fprintf(f, "%s=", chroma ? "PRIMARIES" : a->name);
    if (a->kind == IMG_ATTR_FLOATS || chroma) {
        for (int i = 0; i < (chroma ? 8 : a->n); i++) fprintf(f, "%s%.9g", i ? " " : "", (double)a->f[i]);
    } else {
        for (int i = 0; i < n; i++) fprintf(f, "%s%.9g", i ? " " : "", a->v[i]);
    }
    putc('\n', f);
}

int img_write_hdr(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e)
{
    FILE *f = out_stream(o);
    int w = im->info.width, h = im->info.height, nc = im->info.channels;
    size_t width = (size_t)w;
    unsigned char *planes = malloc(4 * width);
    if (!planes) return err_set(e, "%s: out of memory", path);
    fputs("#?RADIANCE\n", f);
    if (opts->comment) put_line_of_text(f, NULL, opts->comment);
    for (int i = 0; i < opts->nattrs; i++) put_attr(f, &opts->attrs[i]);
    fprintf(f, "FORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n", h, w);

    int rle = w >= RLE_MIN && w <= RLE_MAX;
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            const float *p = im->pix + ((size_t)y * width + (size_t)x) * (size_t)nc;
            float rgb[3] = {p[0], nc >= 3 ? p[1] : p[0], nc >= 3 ? p[2] : p[0]};
            unsigned char b[4];
            for (int c = 0; c < 3; c++) {
                if (rgb[c] >= 0x1p127f) {
                    free(planes);
                    return err_set(e, "%s: expected values below 1.7e38, found %g in pixel (%d, %d)", path,
                                   (double)rgb[c], x, y);
                }
            }
            to_rgbe(b, rgb);
            for (size_t c = 0; c < 4; c++) {
                if (rle) planes[c * width + (size_t)x] = b[c];
                else planes[4 * (size_t)x + c] = b[c];
            }
        }
        if (!rle) {
            fwrite(planes, 4, width, f);
            continue;
        }
        const unsigned char start[4] = {2, 2, (unsigned char)(w >> 8), (unsigned char)(w & 255)};
        fwrite(start, 1, 4, f);
        for (size_t c = 0; c < 4; c++) put_component(f, planes + c * width, w);
    }
    free(planes);
    return 0; /* write errors show at commit */
}
