/*
 * image_exr.c - reading OpenEXR: the picture that its display window shows, as straight R, G, B(, A) or
 * grey(, A).
 *
 * Windows: pixels lie at their place in the display window.  What the data window has beyond it (overscan) is
 * cut off; where it does not reach, the picture is unknown: black with alpha 0, for which it gets an alpha
 * channel.
 *
 * Alpha: OpenEXR's colours are multiplied by alpha, ours are not: for 0 < A < 1 they are divided by it. Light
 * where A = 0 (a flame, a glow: it hides nothing and is there all the same; or an alpha channel that nobody
 * filled) is kept as it is and gets alpha 1, so that it counts as seen.  Files of ours say that theirs are
 * straight (EXR_STRAIGHT).
 *
 * Colours: values are for Rec. 709's primaries and white, OpenEXR's default, or for Radiance's own; others
 * stated by the attribute chromaticities go through XYZ to Rec. 709's (image_colour.c).
 *
 * Rows are decoded a band at a time (the lines of a chunk, or a row of tiles): memory does not grow with the
 * height.
 */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/remark.h"
#include "exr/exr_bytes.h"
#include "image_exr.h"

/* A display window of more pixels than EMPTY_PIXELS may be at most EMPTY_TIMES the data window: it costs
 * memory. */
static const int64_t empty_pixels = (int64_t)1 << 26;
enum { EMPTY_TIMES = 64 };

typedef struct exr_state {
    exr_file *file;
    exr_choice choice;
    const exr_part *part;
    int lines, first; /* rows of a band; the first one that is in it (of the data window), -1: none */
    float *band;
    int straight; /* alpha need not be divided out */
    int recolour;
    double matrix[3][3];
} exr_state;

static int exr_sniff(const unsigned char *head, size_t n)
{
    return exr_is_magic(head, n);
}

static int exr_bad(const img_reader *r, errmsg *e, const char *why)
{
    return img_bad(r, e, "broken OpenEXR file: %s", why);
}

/* ---- header ------------------------------------------------------------------------------------------ */

static int64_t side(const int w[4], int axis)
{
    return (int64_t)w[axis + 2] - w[axis] + 1;
}

/* The display window's size, and whether all of it is known. */
static int check_windows(img_reader *r, const exr_part *p, int *covered, errmsg *e)
{
    int64_t w = side(p->display, 0), h = side(p->display, 1), dw = side(p->data, 0), dh = side(p->data, 1);
    if (img_check_size(r->path, w, h, e) < 0) return -1;
    *covered = 1;
    for (int k = 0; k < 2; k++) {
        if (p->data[k] > p->display[k + 2] || p->data[k + 2] < p->display[k])
            return img_bad(
                r, e,
                "expected a data window inside the display window (%d,%d)-(%d,%d), found (%d,%d)-(%d,%d)",
                p->display[0], p->display[1], p->display[2], p->display[3], p->data[0], p->data[1],
                p->data[2], p->data[3]);
        *covered = *covered && p->data[k] <= p->display[k] && p->data[k + 2] >= p->display[k + 2];
    }
    if (w * h > empty_pixels && w * h / EMPTY_TIMES > dw * dh)
        return img_bad(r, e,
                       "expected a data window of at least 1/%d of the display window's %lldx%lld pixels, "
                       "found %lldx%lld",
                       EMPTY_TIMES, (long long)w, (long long)h, (long long)dw, (long long)dh);
    return 0;
}

/* Luminance is at every pixel and chroma at every second one, or the library doesn't take it; 0: another
 * channel. */
static int luma_sampling(const char *layer, const char *channel)
{
    size_t n = strlen(layer);
    if (n && (strncmp(channel, layer, n) != 0 || channel[n] != '.')) return 0;
    const char *last = n ? channel + n + 1 : channel;
    return strcmp(last, "RY") == 0 || strcmp(last, "BY") == 0 ? 2 : strcmp(last, "Y") == 0;
}

static int check_part(img_reader *r, const exr_state *s, errmsg *e)
{
    const exr_part *p = s->part;
    if (!p->complete) return img_bad(r, e, "incomplete OpenEXR file: pixels were never written");
    if (p->envmap == 1)
        return img_bad(r, e,
                       "expected a picture or a latitude/longitude map, found a cube map (attribute envmap)");
    if (s->choice.luma && exr_file_parts(s->file) > 1)
        return img_bad(
            r, e,
            "expected channels R, G, B in a file of several parts, found luminance and chroma (Y, RY, BY)");
    for (int c = 0; c < p->channels; c++) {
        const exr_channel *x = &p->channel[c];
        int want = s->choice.luma ? luma_sampling(s->choice.name[0], x->name) : 0;
        for (int k = 0; k < s->choice.n && !s->choice.luma; k++)
            if (strcmp(x->name, s->choice.name[k]) == 0) want = 1;
        if (want && (x->x_sampling != want || x->y_sampling != want))
            return img_bad(r, e, "expected channel %s at every %spixel, found it subsampled %dx%d", x->name,
                           want == 2 ? "second " : "", x->x_sampling, x->y_sampling);
    }
    return 0;
}

static int take_colours(img_reader *r, exr_state *s, errmsg *e)
{
    if (!s->part->has_chroma || s->choice.n < 3) return 0;
    int rc = img_primaries(s->matrix, s->part->chroma);
    if (rc < 0) return img_bad(r, e, "expected chromaticities that make a colour space, found others");
    s->recolour = rc;
    if (rc)
        remark(
            r->path,
            "colours converted from its own primaries to Rec. 709's, through XYZ without adapting the white");
    return 0;
}

static double fact(const exr_state *s, const char *name)
{
    char text[64];
    if (!exr_file_fact(s->file, s->choice.part, name, text, sizeof text)) return 0;
    double v = strtod(text, NULL);
    return isfinite(v) && v > 0 ? v : 0;
}

static int exr_open(img_reader *r, errmsg *e)
{
    char why[EXR_NAME];
    const char *names[EXR_PICKED];
    int covered = 1;
    exr_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    s->first = -1;
    if (exr_check(r, e) < 0) return -1;
    if (exr_file_open(&s->file, fileno(r->f), r->bytes, why) < 0) return exr_bad(r, e, why);
    if (exr_choose(&s->choice, s->file, r->opts.layer, r, e) < 0) return -1;
    s->part = exr_file_part(s->file, s->choice.part);
    if (check_part(r, s, e) < 0 || check_windows(r, s->part, &covered, e) < 0 || take_colours(r, s, e) < 0)
        return -1;
    for (int k = 0; k < EXR_PICKED; k++) names[k] = s->choice.name[k];
    if (exr_file_pick(s->file, s->choice.part, names, s->choice.n, s->choice.luma, why) < 0)
        return exr_bad(r, e, why);
    s->lines = exr_file_lines(s->file);
    s->straight = s->part->straight_alpha;
    if (*s->choice.said) remark(r->path, "%s", s->choice.said);
    if (isfinite(s->part->pixel_aspect) && s->part->pixel_aspect > 0)
        r->info.pixel_aspect = 1 / s->part->pixel_aspect;
    r->info.panorama = s->part->envmap == 0;
    r->info.cropped = !covered;
    r->info.exposure_s = fact(s, "expTime");
    r->info.f_number = fact(s, "aperture");
    r->info.iso = fact(s, "isoSpeed");
    int n = s->choice.n, alpha = n == 2 || n == 4;
    return img_set_info(r, side(s->part->display, 0), side(s->part->display, 1), n + (!alpha && !covered), 0,
                        e);
}

static void exr_close(img_reader *r)
{
    exr_state *s = r->state;
    if (!s) return;
    exr_file_close(s->file);
    free(s->band);
    free(s);
}

static int exr_fact(img_reader *r, const char *name, char *text, size_t room)
{
    exr_state *s = r->state;
    return exr_file_fact(s->file, s->choice.part, name, text, room) ||
           exr_file_fact(s->file, 0, name, text, room);
}

/* ---- pixels ------------------------------------------------------------------------------------------ */

/* Row y of the data window, wherever the band has it. */
static int data_row(float **row, img_reader *r, exr_state *s, int y, errmsg *e)
{
    char why[EXR_NAME];
    int64_t h = side(s->part->data, 1);
    size_t stride = (size_t)side(s->part->data, 0) * (size_t)s->choice.n;
    int first = y - y % s->lines;
    if (!s->band) {
        int64_t rows = s->lines < h ? s->lines : h;
        s->band = malloc(stride * (size_t)rows * sizeof *s->band);
        if (!s->band) return img_bad(r, e, "out of memory");
    }
    if (s->first != first) {
        int64_t last = first + s->lines < h ? first + s->lines - 1 : h - 1;
        s->first = -1;
        if (exr_file_rows(s->file, s->band, s->part->data[1] + first, (int)(s->part->data[1] + last), why) <
            0)
            return img_bad(r, e, "broken OpenEXR file: pixels missing or damaged (%s)", why);
        s->first = first;
    }
    *row = s->band + stride * (size_t)(y - first);
    return 0;
}

/* One pixel of n channels as straight Rec. 709. */
static void convert(float *p, int n, const exr_state *s)
{
    int alpha = n == 2 || n == 4, colours = n - alpha;
    if (alpha && !s->straight) {
        int light = 0;
        for (int c = 0; c < colours; c++) light |= p[c] != 0;
        if (p[colours] > 0 && p[colours] < 1)
            for (int c = 0; c < colours; c++) p[c] = (float)((double)p[c] / (double)p[colours]);
        else if (p[colours] == 0 && light) p[colours] = 1;
    }
    if (!s->recolour) return;
    double v[3] = {(double)p[0], (double)p[1], (double)p[2]};
    for (int c = 0; c < 3; c++)
        p[c] = (float)(s->matrix[c][0] * v[0] + s->matrix[c][1] * v[1] + s->matrix[c][2] * v[2]);
}

static int exr_row(img_reader *r, float *row, errmsg *e)
{
    exr_state *s = r->state;
    const exr_part *p = s->part;
    int nc = r->info.channels, n = s->choice.n;
    int64_t y = (int64_t)p->display[1] + r->y - p->data[1]; /* in the data window */
    int64_t shift = (int64_t)p->display[0] - p->data[0];    /* from our column to its */
    memset(row, 0, (size_t)r->info.width * (size_t)nc * sizeof *row);
    if (y < 0 || y >= side(p->data, 1)) return 0;
    float *from;
    if (data_row(&from, r, s, (int)y, e) < 0) return -1;
    int64_t x0 = shift < 0 ? -shift : 0, x1 = side(p->data, 0) - shift;
    if (x1 > r->info.width) x1 = r->info.width;
    for (int64_t x = x0; x < x1; x++) {
        float *to = row + x * nc;
        memcpy(to, from + (x + shift) * n, (size_t)n * sizeof *to);
        if (nc > n) to[n] = 1;
        if (s->choice.luma && isinf(to[0] + to[1] + to[2]))
            return img_bad(
                r, e, "expected values up to 65504 with luminance and chroma, found more in pixel (%d, %d)",
                (int)x, r->y);
        if (s->recolour || nc == 2 || nc == 4) convert(to, nc, s);
    }
    return 0;
}

const img_codec img_codec_exr = {"exr", exr_sniff, exr_open, exr_row, exr_close, exr_fact};
