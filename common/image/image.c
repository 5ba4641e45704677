/*
 * image.c - reading pictures: which format it is, the row stream, whole pictures; see image.h.
 */
#include "image.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "image_internal.h"

/* raw comes before TIFF, since many raw files are TIFFs */
static const img_codec *const codecs[] = {&img_codec_exr,  &img_codec_png, &img_codec_jpeg, &img_codec_raw,
                                          &img_codec_tiff, &img_codec_pnm, &img_codec_hdr};
enum { NCODECS = sizeof codecs / sizeof *codecs };

int img_bad(const img_reader *r, errmsg *e, const char *fmt, ...)
{
    char words[sizeof e->text];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(words, sizeof words, fmt, ap);
    va_end(ap);
    return err_set(e, "%s: %s", r->path, words);
}

int img_check_size(const char *path, int64_t width, int64_t height, errmsg *e)
{
    if (width < 1 || height < 1 || width > IMG_MAX_SIDE || height > IMG_MAX_SIDE ||
        width * height > IMG_MAX_PIXELS)
        return err_set(
            e, "%s: expected a picture of 1 to %d pixels a side and at most %lld in all, found %lldx%lld",
            path, IMG_MAX_SIDE, (long long)IMG_MAX_PIXELS, (long long)width, (long long)height);
    return 0;
}

int img_set_info(img_reader *r, int64_t width, int64_t height, int channels, double max_code, errmsg *e)
{
    if (img_check_size(r->path, width, height, e) < 0) return -1;
    r->info.width = (int)width;
    r->info.height = (int)height;
    r->info.channels = channels;
    r->info.coded = max_code > 0;
    r->info.max_code = max_code;
    if (!r->info.format[0]) snprintf(r->info.format, sizeof r->info.format, "%s", r->codec->format);
    return 0;
}

/* ---- opening --------------------------------------------------------------------------------- */

/* What can't be rewound (a pipe, standard input) is copied to a file without a name first. */
static FILE *spool(FILE *in)
{
    char buf[1 << 16];
    size_t n;
    FILE *out = tmpfile();
    if (!out) return NULL;
    while ((n = fread(buf, 1, sizeof buf, in)) > 0) {
        if (fwrite(buf, 1, n, out) != n) break;
    }
    if (ferror(in) || ferror(out) || fflush(out) == EOF || fseek(out, 0, SEEK_SET) != 0) {
        int code = errno;
        fclose(out);
        errno = code;
        return NULL;
    }
    return out;
}

/* Standard input is read once and kept: it can be opened again, as a file can. */
static FILE *standard_input(void)
{
    static int kept = -1;
    char name[32];
    if (kept < 0) {
        FILE *f = spool(stdin);
        if (f) kept = dup(fileno(f));
        return f;
    }
    snprintf(name, sizeof name, "/dev/fd/%d", kept);
    return fopen(name, "rb"); /* with a place of its own in it */
}

static int open_file(img_reader *r, const char *path, errmsg *e)
{
    int is_stdin = strcmp(path, "-") == 0;
    r->path = strdup(is_stdin ? "standard input" : path);
    if (!r->path) return err_set(e, "%s: out of memory", path);
    FILE *in = is_stdin ? stdin : fopen(path, "rb");
    if (!in) return err_errno(e, "%s: can't read", path);
    struct stat st;
    if (fstat(fileno(in), &st) < 0 || S_ISDIR(st.st_mode)) {
        if (!is_stdin) fclose(in);
        return img_bad(r, e, "expected a picture, found a folder");
    }
    if (S_ISREG(st.st_mode) && !is_stdin) {
        r->f = in;
    } else {
        r->f = is_stdin ? standard_input() : spool(in);
        if (!r->f) err_errno(e, "%s: can't read", r->path);
        if (!is_stdin) fclose(in);
        if (!r->f) return -1;
        if (fstat(fileno(r->f), &st) < 0) return err_errno(e, "%s: can't read", r->path);
    }
    r->bytes = st.st_size;
    return 0;
}

static int choose_codec(img_reader *r, errmsg *e)
{
    unsigned char head[IMG_HEAD];
    size_t n = fread(head, 1, sizeof head, r->f);
    if (ferror(r->f)) return err_errno(e, "%s: can't read", r->path);
    if (n == 0) return img_bad(r, e, "expected a picture, found an empty file");
    rewind(r->f);
    for (int i = 0; i < NCODECS && !r->codec; i++) {
        if (!codecs[i]->sniff(head, n)) continue;
        int tiff_raw = codecs[i] == &img_codec_raw && img_codec_tiff.sniff(head, n);
        if (tiff_raw && !img_tiff_is_raw(r->f)) continue;
        r->codec = codecs[i];
    }
    rewind(r->f);
    const char *foreign = r->codec ? NULL : img_foreign(head, n);
    if (foreign)
        return img_bad(r, e,
                       "expected a picture that is read here (EXR, Radiance, PNG, JPEG, TIFF, PNM, raw), "
                       "found %s",
                       foreign);
    if (!r->codec)
        return img_bad(r, e,
                       "expected a picture (EXR, Radiance, PNG, JPEG, TIFF, PNM, PFM or camera raw), "
                       "found something else");
    return 0;
}

int img_reader_open(img_reader **out, const char *path, errmsg *e)
{
    return img_reader_open_as(out, path, NULL, e);
}

/* What our own programs write of panoramas: ilf:latlong "LEFT RIGHT TOP BOTTOM" of a part of one, ilf:pose "HEADING
 * PITCH ROLL" of its camera, x for what was not stated. */
static void own_panorama(img_reader *r)
{
    char text[128], word[3][32], *end;
    img_panorama *p = &r->info.pano;
    double *q = p->shows_deg, v[4];
    if (img_reader_fact(r, "ilf:latlong", text, sizeof text) &&
        sscanf(text, "%lf %lf %lf %lf", v, v + 1, v + 2, v + 3) == 4)
        memcpy(q, v, sizeof v);
    if (!img_reader_fact(r, "ilf:pose", text, sizeof text) ||
        sscanf(text, "%31s %31s %31s", word[0], word[1], word[2]) != 3)
        return;
    for (int k = 0; k < 3; k++) {
        p->pose_deg[k] = strtod(word[k], &end);
        p->has_pose[k] = end > word[k] && !*end && isfinite(p->pose_deg[k]);
        if (!p->has_pose[k]) p->pose_deg[k] = 0;
    }
}

int img_reader_open_as(img_reader **out, const char *path, const img_open_opts *opts, errmsg *e)
{
    img_reader *r = calloc(1, sizeof *r);
    if (!r) return err_set(e, "%s: out of memory", path);
    if (opts) r->opts = *opts;
    r->info.orientation = 1;
    r->info.pixel_aspect = 1;
    int bad = open_file(r, path, e) < 0 || choose_codec(r, e) < 0 || r->codec->open(r, e) < 0;
    if (!bad) own_panorama(r);
    if (bad || img_shape_open(r, e) < 0) {
        img_reader_close(r);
        return -1;
    }
    *out = r;
    return 0;
}

void img_reader_close(img_reader *r)
{
    if (!r) return;
    if (r->codec) r->codec->close(r);
    img_shape_close(r);
    if (r->f) fclose(r->f);
    free((char *)r->path);
    free(r);
}

/* ---- rows ------------------------------------------------------------------------------------ */

const img_info *img_reader_info(const img_reader *r)
{
    return &r->shown;
}

int img_reader_fact(img_reader *r, const char *name, char *text, size_t room)
{
    return r->codec->fact ? r->codec->fact(r, name, text, room) : 0;
}

int img_reader_rows(img_reader *r, float *rows, int nrows, errmsg *e)
{
    size_t stride = (size_t)r->shown.width * (size_t)r->shown.channels;
    if (r->failed) return img_bad(r, e, "an earlier row could not be read");
    if (nrows < 0 || nrows > r->shown.height - r->given)
        return img_bad(r, e, "expected to read at most %d more rows, found a request for %d",
                       r->shown.height - r->given, nrows);
    for (int i = 0; i < nrows; i++, r->given++) {
        if (img_shape_row(r, rows + (size_t)i * stride, e) < 0) {
            r->failed = 1;
            return -1;
        }
    }
    return 0;
}

/* ---- whole pictures -------------------------------------------------------------------------- */

static int alloc_pixels(img *im, const img_info *info, const char *path, errmsg *e)
{
    /* zeroed by the system on first touch: a header that lies costs address space only */
    float *pix = calloc((size_t)info->width * (size_t)info->height, (size_t)info->channels * sizeof *pix);
    if (!pix) return err_set(e, "%s: out of memory for %dx%d pixels", path, info->width, info->height);
    im->info = *info;
    im->pix = pix;
    return 0;
}

int img_alloc(img *im, int width, int height, int channels, errmsg *e)
{
    if (channels < 1 || channels > 4)
        return err_set(e, "new picture: expected 1 to 4 channels, found %d", channels);
    if (img_check_size("new picture", width, height, e) < 0) return -1;
    img_info info = {.width = width, .height = height, .channels = channels};
    return alloc_pixels(im, &info, "new picture", e);
}

void img_free(img *im)
{
    free(im->pix);
    memset(im, 0, sizeof *im);
}

int img_load(img *im, const char *path, errmsg *e)
{
    return img_load_as(im, path, NULL, e);
}

int img_load_as(img *im, const char *path, const img_open_opts *opts, errmsg *e)
{
    img_reader *r;
    img got = {0};
    if (img_reader_open_as(&r, path, opts, e) < 0) return -1;
    int rc = alloc_pixels(&got, &r->shown, r->path, e);
    if (rc == 0) rc = img_reader_rows(r, got.pix, r->shown.height, e);
    if (rc == 0) *im = got;
    else img_free(&got);
    img_reader_close(r);
    return rc;
}

int img_probe(img_info *info, const char *path, errmsg *e)
{
    return img_probe_as(info, path, NULL, e);
}

int img_probe_as(img_info *info, const char *path, const img_open_opts *opts, errmsg *e)
{
    img_reader *r;
    if (img_reader_open_as(&r, path, opts, e) < 0) return -1;
    *info = r->shown;
    img_reader_close(r);
    return 0;
}

/* ---- sRGB ------------------------------------------------------------------------------------ */

static double srgb_to_linear(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

void img_linearise_srgb(img *im)
{
    img_info *info = &im->info;
    if (!info->coded) return;
    size_t n = (size_t)info->width * (size_t)info->height, c = (size_t)info->channels;
    size_t colours = c >= 3 ? 3 : 1, ncodes = (size_t)info->max_code + 1;
    float *table = malloc(ncodes * sizeof *table); /* codes are whole numbers: one pow() each */
    for (size_t i = 0; table && i < ncodes; i++) table[i] = (float)srgb_to_linear((double)i / info->max_code);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < c; k++) {
            float *v = &im->pix[i * c + k];
            size_t code = *v >= 0 && (double)*v <= info->max_code ? (size_t)*v : 0;
            if (k >= colours) *v = (float)((double)*v / info->max_code);
            else if (table && (float)code == *v) *v = table[code];
            else *v = (float)srgb_to_linear((double)*v / info->max_code);
        }
    }
    free(table);
    info->coded = 0;
    info->max_code = 0;
}
