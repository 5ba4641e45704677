/*
 * frames.c - see frames.h.  Readers of different exposures run in parallel; each is one thread's at a time.
 */
#include "frames.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STRIP_ROWS = 64 };
static const double same_depth = 1.5;                 /* white levels of one series differ by less */
static const int64_t strip_bytes = (int64_t)96 << 20; /* of codes, all exposures together */

typedef struct frame {
    const char *path;
    img_reader *r;
    img_info info;
    sensor_facts *sensor; /* camera raw, else NULL */
    float *rows;          /* one row as the reader gives it */
    uint16_t *strip;      /* strip_rows of codes */
    uint8_t *kept8;       /* whole picture, or NULL */
    uint16_t *kept16;
    uint8_t *gone,
        *kept_gone;  /* mask of the strip and of the whole picture, or NULL: nothing can be missing */
    int64_t present; /* pixels so far that are not missing */
    FILE *spool, *spool_gone; /* codes, mask */
    int failed;
    errmsg why;
} frame;

struct frames {
    frames_facts facts;
    int bits, half, strip_rows, y, have_all; /* have_all: every row is kept or spooled */
    int keep, fill[3], has_fill, wants_fill;
    frame *f;
};

static size_t row_codes(const frames *f)
{
    return (size_t)f->facts.width * (size_t)f->facts.channels;
}

const frames_facts *frames_get_facts(const frames *f)
{
    return &f->facts;
}

const img_info *frames_info(const frames *f, int k)
{
    return &f->f[k].info;
}

const sensor_facts *frames_sensor(const frames *f, int k)
{
    return f->f[k].sensor;
}

int frames_strip_rows(const frames *f)
{
    return f->strip_rows;
}

void frames_close(frames *f)
{
    if (!f) return;
    for (int k = 0; f->f && k < f->facts.n; k++) {
        frame *p = &f->f[k];
        img_reader_close(p->r);
        free(p->sensor);
        free(p->rows);
        free(p->strip);
        free(p->kept8);
        free(p->kept16);
        free(p->gone);
        free(p->kept_gone);
        if (p->spool) fclose(p->spool);
        if (p->spool_gone) fclose(p->spool_gone);
    }
    free(f->f);
    free(f);
}

static int colour_channels(const img_info *i)
{
    return i->channels >= 3 ? 3 : 1;
}

static int has_alpha(const img_info *i)
{
    return i->channels == 2 || i->channels == 4;
}

static int any_alpha(const frames *f)
{
    int any = 0;
    for (int k = 0; k < f->facts.n; k++) any |= has_alpha(&f->f[k].info);
    return any;
}

static int top_code(const frames *f, const img_info *i)
{
    int top = i->coded ? (int)i->max_code : SENSOR_CLIPPED, asked = (1 << f->bits) - 1;
    return f->bits && asked < top ? asked : top;
}

/* One camera, one way of reading its sensor out. */
static int same_sensor(const frames *f, int k, errmsg *e)
{
    const sensor_facts *a = f->f[0].sensor, *b = f->f[k].sensor;
    if (strcmp(a->camera, b->camera) != 0)
        return err_set(e, "%s: expected a shot of the camera that made %s (%s), found %s", f->f[k].path,
                       f->f[0].path, a->camera, b->camera);
    if (a->channels != b->channels || memcmp(&a->mosaic, &b->mosaic, sizeof a->mosaic) != 0)
        return err_set(e, "%s: expected the colour filters of %s, found others", f->f[k].path, f->f[0].path);
    if (f->half && !cfa_is_bayer(&b->mosaic))
        return err_set(e, "%s: expected a Bayer sensor with --half-size, found %s (%s)", f->f[k].path,
                       b->mosaic.columns ? "another pattern" : "no pattern", b->camera);
    return 0;
}

static int agree(const frames *f, int k, errmsg *e)
{
    const img_info *a = &f->f[0].info, *b = &f->f[k].info;
    const char *path = f->f[k].path, *first = f->f[0].path;
    int raw = f->f[k].sensor != NULL;
    if (k && raw != (f->f[0].sensor != NULL))
        return err_set(e, "%s: expected %s as %s is, found %s: one series is of one kind", path,
                       raw ? "coded values" : "camera raw", first, b->format);
    if (!b->coded && !raw)
        return err_set(e, "%s: expected codes of a camera (PNG, JPEG, TIFF, PNM, raw), found radiance (%s)",
                       path, b->format);
    if (b->coded && (b->max_code < 3 || b->max_code > 65535))
        return err_set(e, "%s: expected codes up to 3..65535, found %g", path, b->max_code);
    if (a->width != b->width || a->height != b->height)
        return err_set(e, "%s: expected %dx%d pixels as in %s, found %dx%d", path, a->width, a->height, first,
                       b->width, b->height);
    if (colour_channels(a) != colour_channels(b))
        return err_set(e, "%s: expected a %s image as %s is, found %s", path,
                       colour_channels(a) == 3 ? "colour" : "grey", first,
                       colour_channels(b) == 3 ? "colour" : "grey");
    if (raw) return same_sensor(f, k, e);
    if (top_code(f, a) != top_code(f, b) || a->coded != b->coded)
        return err_set(e, "%s: expected codes 0..%d as in %s, found 0..%d", path, top_code(f, a), first,
                       top_code(f, b));
    return 0;
}

/* Pixels as they lie in the file: those of one series lie alike on the sensor, whatever the tags say. */
static const img_open_opts as_stored = {.keep_orientation = 1};

static int open_one(frames *f, int k, errmsg *e)
{
    frame *p = &f->f[k];
    if (img_reader_open_as(&p->r, p->path, &as_stored, e)) return -1;
    p->info = *img_reader_info(p->r);
    int raw = strcmp(p->info.format, "raw") == 0;
    if (!raw)
        return f->half
                   ? err_set(e, "%s: expected camera raw with --half-size, found %s", p->path, p->info.format)
                   : 0;
    img_reader_close(p->r); /* it develops; we want the sensor's values */
    p->r = NULL;
    p->sensor = malloc(sizeof *p->sensor);
    if (!p->sensor) return err_set(e, "out of memory");
    if (f->bits || f->wants_fill)
        return err_set(e, "%s: expected no %s with camera raw, whose values are known", p->path,
                       f->bits ? "--bits" : "--fill");
    if (sensor_probe(p->sensor, p->path, e)) return -1;
    p->info.width = p->sensor->width;
    p->info.height = p->sensor->height;
    p->info.channels = p->sensor->channels;
    p->info.orientation = p->sensor->orientation;
    return 0;
}

int frames_open(frames **out, char *const *paths, int n, int64_t memory, int bits, const int *fill, int half,
                errmsg *e)
{
    frames *f = calloc(1, sizeof *f);
    if (f) f->f = calloc((size_t)n, sizeof *f->f);
    if (!f || !f->f) goto memory;
    f->facts.n = n;
    f->bits = bits;
    f->half = half;
    f->wants_fill = fill != NULL;
    for (int k = 0; k < n; k++) {
        f->f[k].path = paths[k];
        if (open_one(f, k, e) || agree(f, k, e)) goto bad;
    }
    const img_info *i = &f->f[0].info;
    f->facts.width = i->width;
    f->facts.height = i->height;
    f->facts.channels = colour_channels(i);
    f->facts.max_code = top_code(f, i);
    f->facts.raw = f->f[0].sensor != NULL;
    if (f->facts.raw && f->f[0].sensor->mosaic.columns) f->facts.mosaic = &f->f[0].sensor->mosaic;
    for (int c = 0; c < 3; c++) f->facts.clip[c] = f->facts.max_code;
    if (fill && f->facts.channels == 3) {
        f->has_fill = 1;
        memcpy(f->fill, fill, sizeof f->fill);
    }
    int64_t pixels = (int64_t)i->width * i->height, codes = pixels * f->facts.channels;
    int64_t masks = pixels * (f->has_fill || any_alpha(f));
    f->keep = codes * (f->facts.max_code < 256 ? 1 : 2) + masks <= memory / n;
    int64_t rows = strip_bytes / ((int64_t)row_codes(f) * 2 * n);
    f->strip_rows = (int)(rows < 1 ? 1 : rows > STRIP_ROWS ? STRIP_ROWS : rows);
    for (int k = 0; k < n; k++) {
        frame *p = &f->f[k];
        p->rows = malloc((size_t)i->width * (size_t)p->info.channels * sizeof *p->rows);
        p->strip = malloc(row_codes(f) * (size_t)f->strip_rows * sizeof *p->strip);
        if (!p->rows || !p->strip) goto memory;
        if (f->keep && f->facts.max_code < 256) p->kept8 = malloc((size_t)codes);
        else if (f->keep) p->kept16 = malloc((size_t)codes * 2);
        if (f->keep && !p->kept8 && !p->kept16) goto memory;
        if (!f->has_fill && !has_alpha(&p->info)) continue;
        p->gone = malloc((size_t)i->width * (size_t)f->strip_rows);
        p->kept_gone = f->keep ? malloc((size_t)pixels) : NULL;
        if (!p->gone || (f->keep && !p->kept_gone)) goto memory;
    }
    *out = f;
    return 0;
memory:
    err_set(e, "out of memory for a series of %d images", n);
bad:
    frames_close(f);
    return -1;
}

int frames_reorder(frames *f, const int *order, errmsg *e)
{
    size_t n = (size_t)f->facts.n;
    frame *was = malloc(n * sizeof *was);
    if (!was) return err_set(e, "out of memory");
    memcpy(was, f->f, n * sizeof *was);
    for (size_t k = 0; k < n; k++) f->f[k] = was[order[k]];
    free(was);
    return 0;
}

/* The row's mask.  Below full alpha a pixel is a mixture with what lies outside; rounding of alpha itself is
 * let pass. */
static void find_missing(const frames *f, frame *p, const uint16_t *codes, uint8_t *gone)
{
    static const double full = 254.0 / 255;
    int w = f->facts.width, from = p->info.channels;
    double least = full * (p->info.coded ? p->info.max_code : 1);
    for (int x = 0; x < w; x++) {
        const uint16_t *z = codes + (size_t)x * (size_t)f->facts.channels;
        int alpha = has_alpha(&p->info) && p->rows[(size_t)(x + 1) * (size_t)from - 1] < least;
        gone[x] = (uint8_t)(alpha ||
                            (f->has_fill && z[0] == f->fill[0] && z[1] == f->fill[1] && z[2] == f->fill[2]));
        p->present += !gone[x];
    }
}

/* One row of the reader's floats as codes; gone: its mask, or NULL. */
static void to_codes(const frames *f, frame *p, uint16_t *to, uint8_t *gone)
{
    int w = f->facts.width, ch = f->facts.channels, from = p->info.channels;
    float top = (float)f->facts.max_code;
    for (int x = 0; x < w; x++)
        for (int c = 0; c < ch; c++) {
            float v = p->rows[(size_t)x * (size_t)from + (size_t)c] + 0.5f;
            to[(size_t)x * (size_t)ch + (size_t)c] = (uint16_t)(v > 0 ? v < top ? v : top : 0);
        }
    if (!gone) return;
    find_missing(f, p, to, gone);
    for (int x = 0; x < w; x++)
        for (int c = 0; c < ch && gone[x]; c++)
            to[(size_t)x * (size_t)ch + (size_t)c] = (uint16_t)f->facts.max_code;
}

static int spool_raw(frame *p, errmsg *e)
{
    uint16_t *values = NULL;
    if (sensor_read(&values, p->sensor, p->path, e)) return -1;
    size_t n = (size_t)p->info.width * (size_t)p->info.height * (size_t)p->info.channels;
    p->spool = tmpfile();
    int bad = !p->spool || fwrite(values, sizeof *values, n, p->spool) != n || fflush(p->spool) ||
              fseeko(p->spool, 0, SEEK_SET);
    free(values);
    return bad ? err_errno(e, "%s: temporary file", p->path) : 0;
}

int frames_begin(frames *f, void (*progress)(const char *what, double done, double total), errmsg *e)
{
    int top = 0;
    for (int k = 0; k < f->facts.n && f->facts.raw; k++) { /* one at a time: each takes two whole pictures */
        frame *p = &f->f[k];
        int mine = 0;
        if (spool_raw(p, e)) return -1;
        for (int c = 0; c < 3 && p->sensor->clip[c]; c++) {
            mine = p->sensor->clip[c] > mine ? p->sensor->clip[c] : mine;
            if (k == 0 || p->sensor->clip[c] < f->facts.clip[c]) f->facts.clip[c] = p->sensor->clip[c];
        }
        if (k && (mine > same_depth * top || top > same_depth * mine))
            return err_set(
                e,
                "%s: expected a white level of about %d above black as in %s, found %d: another bit depth?",
                p->path, top, f->f[0].path, mine);
        top = mine > top ? mine : top;
        f->facts.max_code = top;
        if (progress) progress("unpacking", k + 1, f->facts.n);
    }
    return 0;
}

/* Rows [y, y+rows) into p->strip. */
static int fetch(frames *f, frame *p, int y, int rows)
{
    size_t n = row_codes(f), at = (size_t)y * n, all = (size_t)rows * n;
    if (f->have_all && p->kept8) {
        for (size_t i = 0; i < all; i++) p->strip[i] = p->kept8[at + i];
        return 0;
    }
    if (f->have_all && p->kept16) return 0; /* frames_next points into kept16 */
    if (p->spool) {
        size_t pixels = (size_t)rows * (size_t)f->facts.width;
        if (fread(p->strip, sizeof *p->strip, all, p->spool) != all ||
            (p->spool_gone && fread(p->gone, 1, pixels, p->spool_gone) != pixels))
            return err_errno(&p->why, "%s: temporary file", p->path);
        for (size_t i = 0; i < all; i++)
            if (p->strip[i] > f->facts.max_code) p->strip[i] = (uint16_t)f->facts.max_code;
    } else {
        for (int j = 0; j < rows; j++) {
            if (img_reader_rows(p->r, p->rows, 1, &p->why)) return -1;
            to_codes(f, p, p->strip + (size_t)j * n,
                     p->gone ? p->gone + (size_t)j * (size_t)f->facts.width : NULL);
        }
    }
    if (p->kept_gone)
        memcpy(p->kept_gone + (size_t)y * (size_t)f->facts.width, p->gone,
               (size_t)rows * (size_t)f->facts.width);
    if (p->kept8)
        for (size_t i = 0; i < all; i++) p->kept8[at + i] = (uint8_t)p->strip[i];
    if (p->kept16) memcpy(p->kept16 + at, p->strip, all * sizeof *p->strip);
    return 0;
}

int frames_rewind(frames *f, errmsg *e)
{
    int whole = f->y == f->facts.height;
    f->have_all |= f->keep && whole;
    for (int k = 0; k < f->facts.n && f->y > 0 && !f->have_all; k++) {
        frame *p = &f->f[k];
        if (p->spool) {
            if (fseeko(p->spool, 0, SEEK_SET) || (p->spool_gone && fseeko(p->spool_gone, 0, SEEK_SET)))
                return err_errno(e, "%s: temporary file", p->path);
        } else {
            img_reader_close(p->r);
            p->r = NULL;
            if (img_reader_open_as(&p->r, p->path, &as_stored, e)) return -1;
        }
    }
    if (f->have_all)
        for (int k = 0; k < f->facts.n; k++) {
            img_reader_close(f->f[k].r);
            f->f[k].r = NULL;
        }
    for (int k = 0; k < f->facts.n && !f->have_all; k++)
        if (!f->f[k].spool_gone) /* those were counted when they were moved */
            f->f[k].present = 0;
    f->y = 0;
    return 0;
}

/* ---- moving one exposure ---------------------------------------------------------------------- */

/* All codes of exposure p, and its mask where it has one. */
static int whole(frames *f, frame *p, uint16_t *codes, uint8_t *gone)
{
    size_t n = row_codes(f), w = (size_t)f->facts.width, h = (size_t)f->facts.height;
    if (f->have_all && (p->kept8 || p->kept16)) {
        for (size_t i = 0; i < n * h; i++) codes[i] = p->kept8 ? p->kept8[i] : p->kept16[i];
        if (p->kept_gone) memcpy(gone, p->kept_gone, w * h);
        return 0;
    }
    if (p->spool)
        return fread(codes, sizeof *codes, n * h, p->spool) == n * h
                   ? 0
                   : err_errno(&p->why, "%s: temporary file", p->path);
    for (size_t y = 0; y < h; y++) {
        if (img_reader_rows(p->r, p->rows, 1, &p->why)) return -1;
        to_codes(f, p, codes + y * n, p->gone ? gone + y * w : NULL);
    }
    return 0;
}

/* What was missing before: a pixel interpolated from such a one is missing, too. */
static void spread_missing(uint8_t *seen, const uint8_t *gone, const motion *m, int w, int h)
{
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            double mx, my;
            motion_apply(m, x, y, &mx, &my);
            for (int corner = 0; corner < 4; corner++) {
                double cx = floor(mx) + (corner & 1), cy = floor(my) + (corner >> 1);
                if (cx >= 0 && cy >= 0 && cx < w && cy < h && gone[(size_t)cy * (size_t)w + (size_t)cx])
                    seen[(size_t)y * (size_t)w + (size_t)x] = 0;
            }
        }
}

static int spool_whole(FILE **to, const void *bytes, size_t n, const char *path, errmsg *e)
{
    if (*to) fclose(*to);
    *to = tmpfile();
    if (!*to || fwrite(bytes, 1, n, *to) != n || fflush(*to) || fseeko(*to, 0, SEEK_SET))
        return err_errno(e, "%s: temporary file", path);
    return 0;
}

/* Moved codes and mask to where the strips will come from. */
static int put_back(frames *f, frame *p, const uint16_t *codes, const uint8_t *gone, errmsg *e)
{
    size_t all = row_codes(f) * (size_t)f->facts.height;
    size_t w = (size_t)f->facts.width, pixels = w * (size_t)f->facts.height;
    if (!p->gone) p->gone = malloc(w * (size_t)f->strip_rows);
    if (!p->gone) return err_set(e, "%s: out of memory", p->path);
    p->present = 0;
    for (size_t i = 0; i < pixels; i++) p->present += !gone[i];
    if (!f->have_all)
        return spool_whole(&p->spool, codes, all * sizeof *codes, p->path, e) ||
                       spool_whole(&p->spool_gone, gone, pixels, p->path, e)
                   ? -1
                   : 0;
    if (!p->kept_gone) p->kept_gone = malloc(pixels);
    if (!p->kept_gone) return err_set(e, "%s: out of memory", p->path);
    memcpy(p->kept_gone, gone, pixels);
    for (size_t i = 0; i < all; i++) {
        if (p->kept8) p->kept8[i] = (uint8_t)codes[i];
        else p->kept16[i] = codes[i];
    }
    return 0;
}

int frames_move(frames *f, int k, const motion *m, const warp_opts *o, errmsg *e)
{
    frame *p = &f->f[k];
    int w = f->facts.width, h = f->facts.height, ch = f->facts.channels;
    size_t pixels = (size_t)w * (size_t)h, all = pixels * (size_t)ch;
    uint16_t *codes = malloc(all * sizeof *codes), *moved = malloc(all * sizeof *moved);
    uint8_t *gone = calloc(pixels, 1), *seen = malloc(pixels);
    int bad =
        codes && moved && gone && seen ? 0 : err_set(e, "%s: out of memory for %dx%d pixels", p->path, w, h);
    if (!bad && whole(f, p, codes, gone)) {
        *e = p->why;
        bad = -1;
    }
    if (!bad) bad = vision_warp(moved, seen, codes, m, o, e);
    if (!bad && memchr(gone, 1, pixels)) spread_missing(seen, gone, m, w, h);
    for (size_t i = 0; i < pixels && !bad; i++) {
        gone[i] = !seen[i];
        for (int c = 0; c < ch && gone[i]; c++)
            moved[i * (size_t)ch + (size_t)c] = (uint16_t)f->facts.max_code;
    }
    free(codes);
    if (!bad) bad = put_back(f, p, moved, gone, e);
    free(moved);
    free(gone);
    free(seen);
    return bad;
}

/* The strip's mask where something in it is missing, else NULL. */
static const uint8_t *mask_of(const frames *f, const frame *p, int rows)
{
    size_t w = (size_t)f->facts.width, n = (size_t)rows * w;
    const uint8_t *mask = f->have_all && p->kept_gone ? p->kept_gone + (size_t)f->y * w : p->gone;
    return mask && memchr(mask, 1, n) ? mask : NULL;
}

int frames_next(frames *f, const uint16_t **codes, const uint8_t **missing, errmsg *e)
{
    int left = f->facts.height - f->y, rows = left < f->strip_rows ? left : f->strip_rows;
    if (rows == 0) return 0;
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < f->facts.n; k++) f->f[k].failed = fetch(f, &f->f[k], f->y, rows);
    for (int k = 0; k < f->facts.n; k++) {
        frame *p = &f->f[k];
        if (p->failed) {
            *e = p->why;
            return -1;
        }
        codes[k] = f->have_all && p->kept16 ? p->kept16 + (size_t)f->y * row_codes(f) : p->strip;
        missing[k] = mask_of(f, p, rows);
        if (p->gone && f->y + rows == f->facts.height && p->present == 0)
            return err_set(
                e, "%s: expected pixels that are not missing (alpha full, not the fill colour), found none",
                p->path);
    }
    f->y += rows;
    return rows;
}
