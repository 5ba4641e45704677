/*
 * image_shape.c - from the rows as a file stores them to the picture as it is to be looked at: turned by its
 * orientation tag (held whole), then stretched so that pixels are square (row by row).
 *
 * Orientation o (TIFF 6.0, tag 274; EXIF's is the same) says where the first stored row and column
 * lie: 1 top, left; 2 top, right; 3 bottom, right; 4 bottom, left; 5 left, top; 6 right, top; 7 right,
 * bottom; 8 left, bottom.
 *
 * Stretching: a pixel's longer side becomes that of several pixels.  Output pixel k of n' along an axis of n
 * stored ones covers [k, k+1)·n/n' of them and is their mean by length, n' >= n, so that at most two have a
 * part in it.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/remark.h"
#include "image_internal.h"

static const double square = 0.01; /* pixels are square to this: Radiance writes no PIXASPECT below it */
static const double most_oblong = 16;

struct img_shape {
    img_order order;
    int turn;       /* order does something */
    int w, h;       /* turned, before stretching */
    int wide, tall; /* stretched along that side */
    void *held;     /* the turned picture */
    int bytes;      /* of a value in it */
    float *two[2];  /* rows to mix */
    int have[2];    /* which rows two[] holds, -1: none */
    int at;         /* next row of held */
};

/* n values into the held picture from value first on. */
static void keep(void *held, int bytes, size_t first, const float *v, size_t n)
{
    if (bytes == 1)
        for (size_t i = 0; i < n; i++) ((uint8_t *)held)[first + i] = (uint8_t)v[i];
    else if (bytes == 2)
        for (size_t i = 0; i < n; i++) ((uint16_t *)held)[first + i] = (uint16_t)v[i];
    else memcpy((float *)held + first, v, n * sizeof *v);
}

void img_held(float *row, const void *held, int bytes, size_t first, size_t n)
{
    if (bytes == 1)
        for (size_t i = 0; i < n; i++) row[i] = ((const uint8_t *)held)[first + i];
    else if (bytes == 2)
        for (size_t i = 0; i < n; i++) row[i] = ((const uint16_t *)held)[first + i];
    else memcpy(row, (const float *)held + first, n * sizeof *row);
}

int img_hold(void **held, int bytes, img_reader *r, int width, int height, int channels, img_order order,
             img_next *next, errmsg *e)
{
    size_t w = (size_t)width, h = (size_t)height, c = (size_t)channels;
    size_t lines = order.columns ? w : h, length = order.columns ? h : w;
    float *line = malloc(length * c * sizeof *line);
    void *all = malloc(w * h * c * (size_t)bytes);
    int rc = line && all ? 0 : img_bad(r, e, "out of memory for %zux%zu pixels", w, h);
    for (size_t l = 0; rc == 0 && l < lines; l++) {
        rc = next(r, line, e);
        for (size_t p = 0; rc == 0 && p < length; p++) {
            size_t x = order.columns ? l : p, y = order.columns ? p : l;
            if (order.flip_x) x = w - 1 - x;
            if (order.flip_y) y = h - 1 - y;
            keep(all, bytes, (y * w + x) * c, line + p * c, c);
        }
    }
    free(line);
    if (rc < 0) free(all);
    else *held = all;
    return rc;
}

/* ---- rows ------------------------------------------------------------------------------------------ */

static int stored_row(img_reader *r, float *row, errmsg *e)
{
    if (r->codec->row(r, row, e) < 0) return -1;
    r->y++;
    return 0;
}

/* The next row of the turned picture. */
static int turned_row(img_reader *r, float *row, errmsg *e)
{
    struct img_shape *s = r->shape;
    size_t stride = (size_t)s->w * (size_t)r->info.channels;
    if (!s->turn) return stored_row(r, row, e);
    if (!s->held &&
        img_hold(&s->held, s->bytes, r, s->w, s->h, r->info.channels, s->order, stored_row, e) < 0)
        return -1;
    img_held(row, s->held, s->bytes, (size_t)s->at++ * stride, stride);
    return 0;
}

/* The mean of two pixels with weights that add up to 1; colours count by their alpha, since they are not
 * multiplied by it. */
static void mix(float *to, const float *a, double wa, const float *b, double wb, int channels)
{
    int alpha = channels == 2 || channels == 4, colours = channels - alpha;
    double share = 1;
    if (!(wb > 0)) { /* so that a NaN next door stays there */
        memcpy(to, a, (size_t)channels * sizeof *to);
        return;
    }
    if (alpha) {
        double va = wa * (double)a[colours], vb = wb * (double)b[colours];
        share = va + vb;
        to[colours] = (float)share;
        if (share > 0) wa = va, wb = vb;
        else share = 1;
    }
    for (int c = 0; c < colours; c++) to[c] = (float)((wa * (double)a[c] + wb * (double)b[c]) / share);
}

/* Which stored pixels have a part in output pixel k, and the second one's share. */
static double parts(int *first, int *second, int k, int out, int in)
{
    double from = (double)k * in / out, to = (double)(k + 1) * in / out;
    int a = (int)floor(from + 1e-9);
    if (a > in - 1) a = in - 1;
    int b = a + 1 < in && to > a + 1 + 1e-9 ? a + 1 : a;
    *first = a;
    *second = b;
    return b > a ? (to - b) / (to - from) : 0;
}

static int tall_row(img_reader *r, float *row, errmsg *e)
{
    struct img_shape *s = r->shape;
    int pick[2];
    size_t nc = (size_t)r->info.channels;
    double share = parts(&pick[0], &pick[1], r->given, r->shown.height, s->h);
    for (int k = 0; k < 2; k++) {
        if (s->have[0] == pick[k] || s->have[1] == pick[k]) continue;
        float *oldest = s->two[0];
        s->two[0] = s->two[1];
        s->two[1] = oldest;
        s->have[0] = s->have[1];
        if (turned_row(r, oldest, e) < 0) return -1;
        s->have[1] = pick[k];
    }
    const float *a = s->two[s->have[0] == pick[0] ? 0 : 1], *b = s->two[s->have[1] == pick[1] ? 1 : 0];
    for (size_t x = 0; x < (size_t)s->w; x++)
        mix(row + x * nc, a + x * nc, 1 - share, b + x * nc, share, (int)nc);
    return 0;
}

static int wide_row(img_reader *r, float *row, errmsg *e)
{
    struct img_shape *s = r->shape;
    size_t nc = (size_t)r->info.channels;
    if (turned_row(r, s->two[0], e) < 0) return -1;
    for (int x = 0; x < r->shown.width; x++) {
        int a, b;
        double share = parts(&a, &b, x, r->shown.width, s->w);
        mix(row + (size_t)x * nc, s->two[0] + (size_t)a * nc, 1 - share, s->two[0] + (size_t)b * nc, share,
            (int)nc);
    }
    return 0;
}

int img_shape_row(img_reader *r, float *row, errmsg *e)
{
    if (!r->shape) return stored_row(r, row, e);
    if (r->shape->tall) return tall_row(r, row, e);
    return r->shape->wide ? wide_row(r, row, e) : turned_row(r, row, e);
}

void img_density(const img_reader *r, double x, double y)
{
    if (x > 0 && y > 0 && fabs(x / y - 1) >= square)
        remark(r->path, "states different densities along x and y (%g, %g); its pixels are taken as square",
               x, y);
}

/* ---- opening --------------------------------------------------------------------------------------- */

static int plan_stretch(img_reader *r, struct img_shape *s, errmsg *e)
{
    double aspect = r->info.pixel_aspect;
    if (fabs(aspect - 1) < square || r->opts.keep_aspect) return 0;
    if (!(aspect <= most_oblong && aspect >= 1 / most_oblong))
        return img_bad(
            r, e, "expected pixels at most %g times as high as wide or as wide as high, found a ratio of %g",
            most_oblong, aspect);
    if (s->order.columns) aspect = 1 / aspect;
    int64_t w = s->w, h = s->h;
    if (aspect > 1) h = llround((double)h * aspect), s->tall = h > s->h;
    else w = llround((double)w / aspect), s->wide = w > s->w;
    if (img_check_size(r->path, w, h, e) < 0) return -1;
    if (!s->tall && !s->wide) return 0;
    remark(r->path, "its pixels are not square (height / width %.4g): %dx%d stretched to %dx%d",
           s->order.columns ? 1 / aspect : aspect, s->w, s->h, (int)w, (int)h);
    r->shown.width = (int)w;
    r->shown.height = (int)h;
    return 0;
}

int img_shape_open(img_reader *r, errmsg *e)
{
    int o = r->turned || r->opts.keep_orientation ? 1 : r->info.orientation;
    struct img_shape *s = r->shape = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    s->order.columns = o >= 5;
    s->order.flip_x = o == 2 || o == 3 || o == 6 || o == 7;
    s->order.flip_y = o == 3 || o == 4 || o == 7 || o == 8;
    s->turn = o > 1;
    s->bytes = !r->info.coded || r->fractions ? 4 : r->info.max_code > 255 ? 2 : 1;
    s->have[0] = s->have[1] = -1;
    s->w = s->order.columns ? r->info.height : r->info.width;
    s->h = s->order.columns ? r->info.width : r->info.height;
    r->shown = r->info;
    r->shown.width = s->w;
    r->shown.height = s->h;
    if (plan_stretch(r, s, e) < 0) return -1;
    size_t row = (size_t)s->w * (size_t)r->info.channels;
    for (int k = 0; k < 2 && (s->tall || s->wide); k++)
        if (!(s->two[k] = malloc(row * sizeof(float)))) return img_bad(r, e, "out of memory");
    if (s->turn || s->tall || s->wide) return 0;
    img_shape_close(r);
    return 0;
}

void img_shape_close(img_reader *r)
{
    if (!r->shape) return;
    free(r->shape->held);
    free(r->shape->two[0]);
    free(r->shape->two[1]);
    free(r->shape);
    r->shape = NULL;
}
