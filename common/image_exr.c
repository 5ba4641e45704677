/*
 * image_exr.c - reading OpenEXR through OpenEXRCore: scan lines or tiles (first level), the first
 * part, channels R, G, B(, A) or Y(, A) or a single one, as float.
 *
 * Rows are decoded a band at a time (the lines of a chunk, or a row of tiles), so memory does not
 * grow with the height.  Row 0 is the top of the data window; the display window is ignored.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "image_exr.h"

typedef struct exr_state {
    exr_context_t ctx;
    exr_attr_box2i_t window;
    int tiled, tile_w;
    int band_rows;       /* lines in a band */
    int band_first;      /* first row of the band in memory, -1: none */
    float *band;         /* band_rows rows */
    const char *from[4]; /* names of the channels wanted, in our order */
    exr_decode_pipeline_t pipe;
    int pipe_ready;
    img_dwa *dwa;         /* DWA has a decoder of its own */
    int chunk_x, chunk_y; /* pixel of the picture at which the chunk in the pipe begins */
} exr_state;

/* What the library said last on this thread; its callback has no better place. */
static _Thread_local char last_words[256];

static void keep_words(exr_const_context_t ctx, exr_result_t code, const char *words)
{
    (void)ctx;
    (void)code;
    snprintf(last_words, sizeof last_words, "%s", words ? words : "");
}

static int exr_bad(const img_reader *r, errmsg *e, exr_result_t rc, const char *what)
{
    const char *why = last_words[0] ? last_words : exr_get_default_error_message(rc);
    return img_bad(r, e, "broken OpenEXR file: %s (%s)", what, why);
}

static int exr_sniff(const unsigned char *head, size_t n)
{
    return n >= 4 && head[0] == 0x76 && head[1] == 0x2f && head[2] == 0x31 && head[3] == 0x01;
}

static int64_t read_at(exr_const_context_t ctx, void *user, void *buf, uint64_t size, uint64_t offset,
                       exr_stream_error_func_ptr_t error)
{
    img_reader *r = user;
    uint64_t done = 0;
    if (offset > INT64_MAX - size) return -1;
    while (done < size) {
        ssize_t n = pread(fileno(r->f), (char *)buf + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            error(ctx, EXR_ERR_READ_IO, "%s", "can't read");
            return -1;
        }
        if (n == 0) break;
        done += (uint64_t)n;
    }
    return (int64_t)done;
}

static int64_t file_size(exr_const_context_t ctx, void *user)
{
    (void)ctx;
    return ((img_reader *)user)->bytes;
}

/* ---- header ------------------------------------------------------------------------------------ */

static const exr_attr_chlist_entry_t *channel(const exr_attr_chlist_t *list, const char *name)
{
    for (int i = 0; i < list->num_channels; i++)
        if (strcmp(list->entries[i].name.str, name) == 0) return &list->entries[i];
    return NULL;
}

/* Which channels, in which order; returns how many or -1. */
static int choose_channels(const img_reader *r, exr_state *s, const exr_attr_chlist_t *list, errmsg *e)
{
    static const char *const rgb[3] = {"R", "G", "B"};
    int n = 0;
    if (channel(list, "R") && channel(list, "G") && channel(list, "B")) {
        for (; n < 3; n++) s->from[n] = rgb[n];
    } else if (channel(list, "Y") && !channel(list, "RY") && !channel(list, "BY")) {
        s->from[n++] = "Y";
    } else if (list->num_channels == 1) {
        s->from[n++] = list->entries[0].name.str;
    } else {
        char names[200] = "";
        for (int i = 0; i < list->num_channels && strlen(names) < 150; i++) {
            strncat(names, i ? ", " : "", 3);
            strncat(names, list->entries[i].name.str, 40);
        }
        return img_bad(r, e, "expected channels R, G, B or Y, found %s", names[0] ? names : "none");
    }
    if (channel(list, "A") && strcmp(s->from[0], "A") != 0) s->from[n++] = "A";
    for (int i = 0; i < n; i++) {
        const exr_attr_chlist_entry_t *c = channel(list, s->from[i]);
        if (c->x_sampling != 1 || c->y_sampling != 1)
            return img_bad(r, e, "expected channel %s at every pixel, found it subsampled %dx%d", s->from[i],
                           c->x_sampling, c->y_sampling);
    }
    return n;
}

static double positive_attr(exr_const_context_t ctx, const char *name)
{
    float v = 0;
    const exr_attribute_t *attr = NULL;
    if (exr_get_attribute_by_name(ctx, 0, name, &attr) != EXR_ERR_SUCCESS || attr->type != EXR_ATTR_FLOAT)
        return 0;
    v = attr->f;
    return isfinite(v) && v > 0 ? (double)v : 0;
}

enum { DWA_TILE = 4096 }; /* pixels a side: 128 MB */

/* What OpenEXRCore 3.1 can't decode: DWA goes another way; B44 of channels that aren't HALF, which it
 * gets wrong without saying so, is refused. */
static int check_compression(img_reader *r, exr_state *s, const exr_attr_chlist_t *list, errmsg *e)
{
    exr_compression_t comp = EXR_COMPRESSION_NONE;
    const char *other = NULL; /* a channel that isn't HALF */
    for (int i = 0; i < list->num_channels; i++)
        if (list->entries[i].pixel_type != EXR_PIXEL_HALF) other = list->entries[i].name.str;
    exr_get_compression(s->ctx, 0, &comp);
    if (comp == EXR_COMPRESSION_DWAA || comp == EXR_COMPRESSION_DWAB) {
        if (strcmp(s->from[0], "R") != 0 && strcmp(s->from[0], "Y") != 0)
            return img_bad(r, e, "expected channels R, G, B or Y with DWA compression, found %.40s",
                           s->from[0]);
        /* the library that decodes it takes memory for whole tiles at once */
        uint32_t tw = 0, th = 0;
        if (exr_get_tile_descriptor(s->ctx, 0, &tw, &th, NULL, NULL) == EXR_ERR_SUCCESS && (tw > DWA_TILE || th > DWA_TILE))
            return img_bad(r, e, "expected tiles of at most %dx%d with DWA compression, found %ux%u", DWA_TILE, DWA_TILE, tw, th);
        return img_dwa_open(&s->dwa, r, s->window.min.x, s->window.min.y, !other, e);
    }
    if (other && (comp == EXR_COMPRESSION_B44 || comp == EXR_COMPRESSION_B44A))
        return img_bad(
            r, e, "expected half channels with B44 compression, found channel %.40s of another type", other);
    return 0;
}

/* How the picture is cut into chunks; refuses what would take unreasonable memory. */
static int open_chunks(img_reader *r, exr_state *s, errmsg *e)
{
    exr_storage_t storage;
    uint64_t unpacked = 0;
    exr_result_t rc = exr_get_storage(s->ctx, 0, &storage);
    if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "no storage type");
    if (storage == EXR_STORAGE_TILED) {
        int32_t tile_w, tile_h;
        rc = exr_get_tile_sizes(s->ctx, 0, 0, 0, &tile_w, &tile_h);
        if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "no tile size");
        s->tiled = 1;
        s->tile_w = tile_w;
        s->band_rows = tile_h;
    } else if (storage == EXR_STORAGE_SCANLINE) {
        int32_t lines;
        rc = exr_get_scanlines_per_chunk(s->ctx, 0, &lines);
        if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "no chunk size");
        s->band_rows = lines;
    } else {
        return img_bad(r, e, "expected an OpenEXR picture, found deep data");
    }
    rc = exr_get_chunk_unpacked_size(s->ctx, 0, &unpacked);
    if (rc != EXR_ERR_SUCCESS || s->band_rows < 1 || unpacked > INT_MAX)
        return img_bad(r, e, "expected chunks of at most %d bytes, found %llu", INT_MAX,
                       (unsigned long long)unpacked);
    if (s->band_rows > r->info.height) s->band_rows = r->info.height;
    return 0;
}

static int exr_open(img_reader *r, errmsg *e)
{
    exr_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = keep_words;
    init.user_data = r;
    init.read_fn = read_at;
    init.size_fn = file_size;
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    last_words[0] = 0;
    s->band_first = -1;
    exr_result_t rc = exr_start_read(&s->ctx, r->path, &init);
    if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "header");
    rc = exr_get_data_window(s->ctx, 0, &s->window);
    if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "no data window");
    int64_t w = (int64_t)s->window.max.x - s->window.min.x + 1,
            h = (int64_t)s->window.max.y - s->window.min.y + 1;
    if (img_check_size(r->path, w, h, e) < 0) return -1;
    const exr_attr_chlist_t *list = NULL;
    rc = exr_get_channels(s->ctx, 0, &list);
    if (rc != EXR_ERR_SUCCESS || !list) return exr_bad(r, e, rc, "no channels");
    int channels = choose_channels(r, s, list, e);
    if (channels < 0 || img_set_info(r, w, h, channels, 0, e) < 0) return -1;
    r->info.exposure_s = positive_attr(s->ctx, "expTime");
    r->info.f_number = positive_attr(s->ctx, "aperture");
    r->info.iso = positive_attr(s->ctx, "isoSpeed");
    if (open_chunks(r, s, e) < 0) return -1;
    return check_compression(r, s, list, e);
}

static void exr_close(img_reader *r)
{
    exr_state *s = r->state;
    if (!s) return;
    if (s->pipe_ready) exr_decoding_destroy(s->ctx, &s->pipe);
    if (s->ctx) exr_finish(&s->ctx);
    img_dwa_close(s->dwa);
    free(s->band);
    free(s);
}

/* ---- pixels ------------------------------------------------------------------------------------ */

static float half_to_float(uint32_t h)
{
    uint32_t sign = (h & 0x8000u) << 16, exponent = (h >> 10) & 31, mantissa = h & 0x3ffu, u;
    float v;
    if (exponent == 0) {
        v = (float)mantissa * 0x1p-24f;
        return sign ? -v : v;
    }
    u = sign | (exponent == 31 ? 0x7f800000u : (exponent + 112) << 23) | mantissa << 13;
    memcpy(&v, &u, sizeof v);
    return v;
}

static float sample_at(const uint8_t *p, int type)
{
    uint32_t u = (uint32_t)p[0] | (uint32_t)p[1] << 8;
    float v;
    if (type == EXR_PIXEL_HALF) return half_to_float(u);
    u |= (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    if (type == EXR_PIXEL_UINT) return (float)u;
    memcpy(&v, &u, sizeof v);
    return v;
}

/* From a chunk as it is stored (line by line, in a line channel by channel, little-endian) to the
 * band.  Instead of the library's own routines: those of 3.1 go wrong where channels are left out. */
static exr_result_t unpack(exr_decode_pipeline_t *pipe)
{
    const img_reader *r = pipe->decoding_user_data;
    const exr_state *s = r->state;
    const uint8_t *p = pipe->unpacked_buffer, *end = p + pipe->chunk.unpacked_size;
    size_t nc = (size_t)r->info.channels, stride = (size_t)r->info.width * nc;
    for (int y = 0; y < pipe->chunk.height; y++) {
        int64_t line = (int64_t)s->window.min.y + s->chunk_y + y;
        for (int c = 0; c < pipe->channel_count; c++) {
            const exr_coding_channel_info_t *ch = &pipe->channels[c];
            size_t bytes = (size_t)ch->bytes_per_element, n = (size_t)ch->width;
            if (ch->y_samples > 1 && line % ch->y_samples != 0) continue;
            if ((size_t)(end - p) < n * bytes) return EXR_ERR_CORRUPT_CHUNK;
            for (size_t k = 0; k < nc; k++) {
                if (strcmp(ch->channel_name, s->from[k]) != 0) continue;
                float *to = s->band + (size_t)y * stride + (size_t)s->chunk_x * nc + k;
                for (size_t x = 0; x < n; x++) to[x * nc] = sample_at(p + x * bytes, ch->data_type);
            }
            p += n * bytes;
        }
    }
    return EXR_ERR_SUCCESS;
}

/* Decode one chunk to column x of the band that begins at row first; it must hold cols x rows pixels. */
static int decode(img_reader *r, exr_state *s, const exr_chunk_info_t *chunk, int x, int first, int cols,
                  int rows, errmsg *e)
{
    if (chunk->width != cols || chunk->height != rows)
        return img_bad(r, e, "broken OpenEXR file: expected a chunk of %dx%d pixels, found %dx%d", cols, rows,
                       chunk->width, chunk->height);
    exr_result_t rc = s->pipe_ready ? exr_decoding_update(s->ctx, 0, chunk, &s->pipe)
                                    : exr_decoding_initialize(s->ctx, 0, chunk, &s->pipe);
    if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "chunk");
    if (!s->pipe_ready) { /* the library's choice of how to read and decompress */
        s->pipe_ready = 1;
        rc = exr_decoding_choose_default_routines(s->ctx, 0, &s->pipe);
        if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "chunk");
    }
    s->chunk_x = x;
    s->chunk_y = first;
    s->pipe.decoding_user_data = r;
    s->pipe.unpack_and_convert_fn = unpack;
    rc = exr_decoding_run(s->ctx, 0, &s->pipe);
    return rc == EXR_ERR_SUCCESS ? 0 : exr_bad(r, e, rc, "pixels");
}

static int read_band(img_reader *r, exr_state *s, errmsg *e)
{
    int w = r->info.width, first = r->y - r->y % s->band_rows;
    int rows = r->info.height - first < s->band_rows ? r->info.height - first : s->band_rows;
    exr_chunk_info_t chunk;
    exr_result_t rc;
    last_words[0] = 0;
    if (!s->tiled) {
        rc = exr_read_scanline_chunk_info(s->ctx, 0, s->window.min.y + first, &chunk);
        if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "row missing");
        return decode(r, s, &chunk, 0, first, w, rows, e);
    }
    for (int x = 0; x < w; x += s->tile_w) {
        int cols = w - x < s->tile_w ? w - x : s->tile_w;
        rc = exr_read_tile_chunk_info(s->ctx, 0, x / s->tile_w, first / s->band_rows, 0, 0, &chunk);
        if (rc != EXR_ERR_SUCCESS) return exr_bad(r, e, rc, "tile missing");
        if (decode(r, s, &chunk, x, first, cols, rows, e) < 0) return -1;
    }
    return 0;
}

static int exr_row(img_reader *r, float *row, errmsg *e)
{
    exr_state *s = r->state;
    if (s->dwa) return img_dwa_row(s->dwa, r, row, e);
    size_t stride = (size_t)r->info.width * (size_t)r->info.channels;
    int first = r->y - r->y % s->band_rows;
    if (!s->band) {
        s->band = malloc(stride * (size_t)s->band_rows * sizeof *s->band);
        if (!s->band) return img_bad(r, e, "out of memory");
    }
    if (s->band_first != first) {
        if (read_band(r, s, e) < 0) return -1;
        s->band_first = first;
    }
    memcpy(row, s->band + stride * (size_t)(r->y - first), stride * sizeof *row);
    return 0;
}

const img_codec img_codec_exr = {"exr", exr_sniff, exr_open, exr_row, exr_close};
