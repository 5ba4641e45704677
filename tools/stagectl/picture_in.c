/* picture_in.c - see picture_in.h. */
#include "picture_in.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#include "image/image.h"

static uint32_t be32(const unsigned char *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

/* Chunks: length, type, data, CRC-32 of type and data; the last is IEND and nothing follows. */
static int png_whole(FILE *f, int64_t size, const char *path, errmsg *e)
{
    unsigned char head[8], buf[16384];
    int64_t at = 8;
    fseek(f, 8, SEEK_SET);
    for (;;) {
        if (fread(head, 1, 8, f) != 8) return err_set(e, "%s: truncated PNG", path);
        int64_t left = be32(head);
        uint32_t crc = (uint32_t)crc32(crc32(0, NULL, 0), head + 4, 4);
        if (at + 12 + left > size) return err_set(e, "%s: truncated PNG", path);
        at += 12 + left;
        while (left > 0) {
            size_t n = left < (int64_t)sizeof buf ? (size_t)left : sizeof buf;
            if (fread(buf, 1, n, f) != n) return err_set(e, "%s: truncated PNG", path);
            crc = (uint32_t)crc32(crc, buf, (uInt)n);
            left -= (int64_t)n;
        }
        if (fread(buf, 1, 4, f) != 4 || be32(buf) != crc) return err_set(e, "%s: damaged PNG", path);
        if (!memcmp(head + 4, "IEND", 4))
            return at == size ? 0 : err_set(e, "%s: bytes after the end of the PNG", path);
    }
}

/* Next number of a PNM header; comments run to the line's end. */
static long pnm_number(FILE *f)
{
    int c;
    long v = 0;
    do {
        c = getc(f);
        if (c == '#')
            while (c != '\n' && c != EOF) c = getc(f);
    } while (c == ' ' || c == '\t' || c == '\n' || c == '\r');
    if (c < '0' || c > '9') return -1;
    for (; c >= '0' && c <= '9' && v < 1000000; c = getc(f)) v = v * 10 + (c - '0');
    return v;
}

static int pnm_whole(FILE *f, int channels, int64_t size, const char *path, errmsg *e)
{
    fseek(f, 2, SEEK_SET);
    long w = pnm_number(f), h = pnm_number(f), max = pnm_number(f);
    if (w < 1 || h < 1 || w > IMG_MAX_SIDE || h > IMG_MAX_SIDE || max < 1 || max > 65535)
        return err_set(e, "%s: damaged PNM header", path);
    int64_t want = ftell(f) + (int64_t)w * h * channels * (max > 255 ? 2 : 1);
    return want == size ? 0
                        : err_set(e, "%s: expected %lld bytes of PNM, found %lld", path, (long long)want,
                                  (long long)size);
}

static int jpeg_ends(FILE *f, const char *path, errmsg *e)
{
    /* cameras pad: the end marker is looked for in the last kilobyte */
    unsigned char tail[1024];
    if (fseek(f, -(long)sizeof tail, SEEK_END) != 0) rewind(f);
    size_t n = fread(tail, 1, sizeof tail, f);
    for (size_t k = 0; k + 1 < n; k++)
        if (tail[k] == 0xff && tail[k + 1] == 0xd9) return 0;
    return err_set(e, "%s: truncated JPEG", path);
}

int picture_whole(const char *path, errmsg *e)
{
    unsigned char head[8] = {0};
    struct stat st;
    FILE *f = fopen(path, "rb");
    if (!f) return err_errno(e, "%s", path);
    int bad = fstat(fileno(f), &st) != 0 ? err_errno(e, "%s", path) : 0, decode = 0;
    size_t n = fread(head, 1, 8, f);
    if (!bad && n == 8 && !memcmp(head, "\x89PNG\r\n\x1a\n", 8)) bad = png_whole(f, st.st_size, path, e);
    else if (!bad && n == 8 && head[0] == 'P' && (head[1] == '5' || head[1] == '6'))
        bad = pnm_whole(f, head[1] == '6' ? 3 : 1, st.st_size, path, e);
    else decode = 1;
    if (!bad && decode && head[0] == 0xff && head[1] == 0xd8) bad = jpeg_ends(f, path, e);
    fclose(f);
    if (!bad && decode) {
        img im;
        bad = img_load(&im, path, e);
        if (!bad) img_free(&im);
    }
    return bad;
}

int picture_shares(double *clip, double *black, const char *path, const picture_levels *l, errmsg *e)
{
    img im;
    if (img_load(&im, path, e) != 0) return -1;
    int w = im.info.width, h = im.info.height, c = im.info.channels, colours = c >= 3 ? 3 : 1;
    if (!im.info.coded) {
        img_free(&im);
        return err_set(e, "%s: auto needs pictures with code numbers (PNG, JPEG, TIFF, PNM)", path);
    }
    double hi = l->clip_level * im.info.max_code, lo = l->black_level * im.info.max_code;
    double r = l->circle * fmin(w, h) / 2, clipped = 0, dark = 0, all = 0;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            if (r > 0 && hypot(x + 0.5 - w / 2.0, y + 0.5 - h / 2.0) > r) continue;
            const float *p = im.pix + ((size_t)y * (size_t)w + (size_t)x) * (size_t)c;
            double top = 0;
            for (int k = 0; k < colours; k++) top = fmax(top, (double)p[k]);
            all++;
            clipped += top >= hi;
            dark += top <= lo;
        }
    img_free(&im);
    if (all == 0) return err_set(e, "%s: no pixel in the image circle", path);
    *clip = clipped / all;
    *black = dark / all;
    return 0;
}
