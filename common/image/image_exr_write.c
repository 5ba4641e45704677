/*
 * image_exr_write.c - writing scan-line OpenEXR through OpenEXRCore: R, G, B(, A) or Y(, A), and
 * whatever further channels and attributes the caller has.  Colours are not multiplied by alpha: an attribute
 * says so.
 */
#include <math.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>

#include "exr/exr_compression.h"
#include "exr/exr_whole.h"
#include "image_exr.h"

enum { MAX_CHANNELS = 64 };

typedef struct source {
    const char *name;
    const float *pix;
    size_t stride; /* floats between pixels */
    img_type type;
} source;

static _Thread_local char last_words[256];

static void keep_words(exr_const_context_t ctx, exr_result_t code, const char *words)
{
    (void)ctx;
    (void)code;
    snprintf(last_words, sizeof last_words, "%s", words ? words : "");
}

static int failed(const char *path, errmsg *e, exr_result_t rc, const char *what)
{
    return err_set(e, "%s: can't write %s: %s", path, what,
                   last_words[0] ? last_words : exr_get_default_error_message(rc));
}

static int compression(const char *path, const char *name, exr_compression_t *out, errmsg *e)
{
    const int number = exr_compression_number(name ? name : "zip");
    switch (number) {
    case EXR_COMPRESSION_NONE:
    case EXR_COMPRESSION_RLE:
    case EXR_COMPRESSION_ZIPS:
    case EXR_COMPRESSION_ZIP:
    case EXR_COMPRESSION_PIZ:
    case EXR_COMPRESSION_DWAA: *out = (exr_compression_t)number; return 0;
    default: break;
    }
    return err_set(e, "%s: expected compression none, rle, zips, zip, piz or dwaa, found '%s'", path, name);
}

/* All channels of the file, ours first. */
static int list_sources(const img *im, const img_write_opts *opts, source *src)
{
    static const char *const names[4][4] = {{"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
    int n = 0;
    for (; n < im->info.channels; n++)
        src[n] =
            (source){names[im->info.channels - 1][n], im->pix + n, (size_t)im->info.channels, opts->type};
    for (int i = 0; i < opts->nplanes; i++) {
        const img_plane *p = &opts->planes[i];
        src[n++] = (source){p->name, p->pix, p->stride, p->type};
    }
    return n;
}

static exr_result_t put_attr(exr_context_t ctx, const img_attr *a)
{
    switch (a->kind) {
    case IMG_ATTR_STRING: return exr_attr_set_string(ctx, 0, a->name, a->s);
    case IMG_ATTR_FLOAT: return exr_attr_set_float(ctx, 0, a->name, (float)a->v[0]);
    case IMG_ATTR_INT: return exr_attr_set_int(ctx, 0, a->name, (int32_t)a->v[0]);
    case IMG_ATTR_FLOATS: return exr_attr_set_float_vector(ctx, 0, a->name, a->n, a->f);
    case IMG_ATTR_CHROMATICITIES: {
        exr_attr_chromaticities_t c = {a->f[0], a->f[1], a->f[2], a->f[3],
                                       a->f[4], a->f[5], a->f[6], a->f[7]};
        return exr_attr_set_chromaticities(ctx, 0, a->name, &c);
    }
    case IMG_ATTR_V3F: {
        exr_attr_v3f_t v = {.x = (float)a->v[0], .y = (float)a->v[1], .z = (float)a->v[2]};
        return exr_attr_set_v3f(ctx, 0, a->name, &v);
    }
    }
    return EXR_ERR_INVALID_ARGUMENT;
}

static int write_header(exr_context_t ctx, const img *im, const char *path, const img_write_opts *opts,
                        const source *src, int nsrc, exr_compression_t comp, errmsg *e)
{
    int part;
    exr_result_t rc = exr_add_part(ctx, "picture", EXR_STORAGE_SCANLINE, &part);
    if (rc == EXR_ERR_SUCCESS)
        rc = exr_initialize_required_attr_simple(ctx, 0, im->info.width, im->info.height, comp);
    if (rc != EXR_ERR_SUCCESS) return failed(path, e, rc, "the header");
    for (int i = 0; i < nsrc; i++) {
        exr_pixel_type_t type = src[i].type == IMG_HALF ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
        rc = (exr_result_t)exr_add_channel(ctx, 0, src[i].name, type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
        if (rc != EXR_ERR_SUCCESS) return failed(path, e, rc, src[i].name);
    }
    if (opts->comment) {
        rc = exr_attr_set_string(ctx, 0, "comments", opts->comment);
        if (rc != EXR_ERR_SUCCESS) return failed(path, e, rc, "attribute comments");
    }
    if (im->info.channels == 2 || im->info.channels == 4) {
        rc = exr_attr_set_string(ctx, 0, EXR_STRAIGHT, EXR_STRAIGHT_VALUE);
        if (rc != EXR_ERR_SUCCESS) return failed(path, e, rc, "attribute " EXR_STRAIGHT);
    }
    for (int i = 0; i < opts->nattrs; i++) {
        rc = put_attr(ctx, &opts->attrs[i]);
        if (rc != EXR_ERR_SUCCESS) return failed(path, e, rc, opts->attrs[i].name);
    }
    rc = exr_write_header(ctx);
    return rc == EXR_ERR_SUCCESS ? 0 : failed(path, e, rc, "the header");
}

static int write_pixels(exr_context_t ctx, const img *im, const char *path, const source *src, int nsrc,
                        errmsg *e)
{
    exr_encode_pipeline_t pipe = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_compress_fn *kept = NULL;
    int32_t lines = 1;
    int started = 0;
    size_t w = (size_t)im->info.width;
    exr_result_t rc = exr_get_scanlines_per_chunk(ctx, 0, &lines);
    for (int y = 0; rc == EXR_ERR_SUCCESS && y < im->info.height; y += lines) {
        exr_chunk_info_t chunk;
        rc = exr_write_scanline_chunk_info(ctx, 0, y, &chunk);
        if (rc != EXR_ERR_SUCCESS) break;
        rc = started ? exr_encoding_update(ctx, 0, &chunk, &pipe)
                     : exr_encoding_initialize(ctx, 0, &chunk, &pipe);
        if (rc != EXR_ERR_SUCCESS) break;
        for (int c = 0; c < pipe.channel_count; c++) {
            exr_coding_channel_info_t *ch = &pipe.channels[c];
            const source *s = src;
            while (s < src + nsrc - 1 && strcmp(s->name, ch->channel_name) != 0) s++;
            ch->user_data_type = EXR_PIXEL_FLOAT;
            ch->user_bytes_per_element = sizeof(float);
            ch->user_pixel_stride = (int32_t)(s->stride * sizeof(float));
            ch->user_line_stride = (int32_t)(s->stride * w * sizeof(float));
            ch->encode_from_ptr = (const uint8_t *)(s->pix + (size_t)y * w * s->stride);
        }
        if (!started) {
            rc = exr_encoding_choose_default_routines(ctx, 0, &pipe);
            exr_keep_incompressible(&pipe, &kept);
        }
        started = 1;
        if (rc == EXR_ERR_SUCCESS) rc = exr_encoding_run(ctx, 0, &pipe);
    }
    if (started) exr_encoding_destroy(ctx, &pipe);
    return rc == EXR_ERR_SUCCESS ? 0 : failed(path, e, rc, "pixels");
}

int img_write_exr(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e)
{
    source src[MAX_CHANNELS];
    exr_compression_t comp = EXR_COMPRESSION_ZIP;
    if (compression(path, opts->compression, &comp, e) < 0) return -1;
    if (comp == EXR_COMPRESSION_DWAA) return img_write_exr_dwa(im, o, path, opts, e);
    if (opts->nplanes < 0 || opts->nplanes > MAX_CHANNELS - im->info.channels)
        return err_set(e, "%s: expected at most %d channels", path, MAX_CHANNELS);
    for (int i = 0; i < opts->nplanes; i++)
        if (opts->planes[i].stride > (1u << 29) / (size_t)im->info.width)
            return err_set(e, "%s: channel %s: stride too large", path, opts->planes[i].name);
    int nsrc = list_sources(im, opts, src);

    exr_context_t ctx = NULL;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = keep_words;
    last_words[0] = 0;
    exr_result_t rc = exr_start_write(&ctx, out_path(o), EXR_WRITE_FILE_DIRECTLY, &init);
    if (rc != EXR_ERR_SUCCESS) return failed(path, e, rc, "the file");
    int bad = write_header(ctx, im, path, opts, src, nsrc, comp, e) < 0 ||
              write_pixels(ctx, im, path, src, nsrc, e) < 0;
    rc = exr_finish(&ctx);
    if (!bad && rc != EXR_ERR_SUCCESS) return failed(path, e, rc, "the chunk table");
    return bad ? -1 : 0;
}
