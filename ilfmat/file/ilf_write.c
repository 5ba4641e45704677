/*
 * ilf_write.c - write an incident light field file (docs/FORMAT.md, section 1).
 */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include "exr/exr_bytes.h"
#include "exr/exr_compression.h"
#include "exr/exr_half.h"
#include "exr/exr_tiles.h"
#include "exr/exr_whole.h"
#include "ilf_lampfile.h"

/* What rounding did so far: sums over nodes. */
typedef struct loss_sums {
    double square, before, after; /* of relative changes, of irradiance */
    int64_t lit;                  /* nodes with light */
    ilf_loss most;                /* worst, texel */
} loss_sums;

struct ilf_writer {
    exr_context_t exr;
    char *path; /* as errors call the file */
    char *file; /* where it is */
    ilf_spec spec;
    int64_t next;   /* probe to come */
    uint16_t *half; /* one probe, when the file holds halves */
    float *rounded; /* one probe, where texels are rounded */
    loss_sums loss;
    ilf_error words; /* OpenEXR's own */
};

/* The writer that this thread is in a call of.  Not the context's user data: asking a context that writes for
 * anything waits for the lock that the failing call holds (OpenEXR 3.1). */
static _Thread_local ilf_writer *at_work;

static void keep_words(exr_const_context_t ctxt, exr_result_t code, const char *msg)
{
    ilf_writer *w = at_work;

    (void)ctxt;
    if (w && !w->words.text[0])
        ilf_fail(&w->words, ILF_ERR_IO, "%s", msg ? msg : exr_get_default_error_message(code));
}

static ilf_status failed(const ilf_writer *w, exr_result_t r, ilf_error *err)
{
    return ilf_fail(err, ILF_ERR_IO, "%s: can't be written: %s", w->path,
                    w->words.text[0] ? w->words.text : exr_get_default_error_message(r));
}

static ilf_status check_spec(const char *path, const ilf_spec *s, exr_compression_t *compression,
                             ilf_error *err)
{
    ilf_frame frame;
    const int sides[4] = {s->n_u, s->n_v, s->n_theta, s->n_phi};
    const char *name = s->compression ? s->compression : "none"; /* of the compression */
    const int k = exr_compression_number(name);

    for (int c = 0; c < 4; c++)
        if (sides[c] < 1 || sides[c] > ILF_MAX_SIDE)
            return ilf_fail(err, ILF_ERR_ARG, "%s: expected grid and probe sizes from 1 to %d, found %d",
                            path, ILF_MAX_SIDE, sides[c]);
    const int64_t w = (s->interleave ? 3 : 1) * (int64_t)s->n_u * s->n_theta, h = (int64_t)s->n_v * s->n_phi;
    if (w > INT32_MAX / 2 || h > INT32_MAX / 2 || (int64_t)s->n_theta * s->n_phi > ILF_MAX_PROBE_BYTES / 12)
        return ilf_fail(err, ILF_ERR_ARG, "%s: %dx%d probes of %dx%d texels are more than a file can hold",
                        path, s->n_u, s->n_v, s->n_theta, s->n_phi);
    if (k < 0)
        return ilf_fail(err, ILF_ERR_ARG,
                        "%s: compression: expected none, rle, zips, zip, piz, pxr24, b44 or b44a, "
                        "found %s",
                        path, name);
    *compression = (exr_compression_t)k;
    if (s->interleave && *compression != EXR_COMPRESSION_NONE)
        return ilf_fail(
            err, ILF_ERR_ARG,
            "%s: compression: expected none for a file that holds its texels interleaved too, found %s", path,
            name);
    if (!(s->tolerance >= 0 && s->tolerance <= 0.5))
        return ilf_fail(err, ILF_ERR_ARG, "%s: tolerance: expected a share from 0 to .5, found %g", path,
                        s->tolerance);
    if (*compression > EXR_COMPRESSION_B44A)
        return ilf_fail(err, ILF_ERR_ARG, "%s: compression: %s is not written; expected another", path, name);
    ilf_status st =
        ilf_check_polar(s->polar_max, s->polar_valid > 0 ? s->polar_valid : s->polar_max, path, err);
    if (st == ILF_OK) st = ilf_check_plane(&frame, s->origin, s->U, s->V, path, err);
    for (int c = 0; c < 3 && st == ILF_OK; c++)
        if (!isfinite((float)s->origin[c]) || !isfinite((float)s->U[c]) || !isfinite((float)s->V[c]))
            st = ilf_fail(err, ILF_ERR_ARG, "%s: plane: expected numbers within float's range", path);
    if (st == ILF_OK) st = ilf_check_lamps(s->lamps, s->n_lamps, (int64_t)s->n_u * s->n_v, path, err);
    return st;
}

static exr_result_t set_vector(exr_context_t x, const char *name, const double v[3])
{
    const exr_attr_v3f_t a = {{{(float)v[0], (float)v[1], (float)v[2]}}};

    return exr_attr_set_v3f(x, 0, name, &a);
}

#define TRY(call)                                                                                            \
    if ((r = (call)) != EXR_ERR_SUCCESS) return r

/* The part that ilf_layout.c describes. */
static exr_result_t add_interleaved(exr_context_t x, const ilf_spec *s, const exr_attr_box2i_t *display)
{
    const exr_attr_box2i_t window = {{{{0, 0}}}, {{{3 * s->n_u * s->n_theta - 1, s->n_v * s->n_phi - 1}}}};
    const exr_attr_v2f_t centre = {{{0, 0}}};
    exr_result_t r;
    int part;

    TRY(exr_add_part(x, ILF_INTERLEAVED_NAME, EXR_STORAGE_TILED, &part));
    TRY(exr_initialize_required_attr(x, part, display, &window, 1.f, &centre, 1.f, EXR_LINEORDER_INCREASING_Y,
                                     EXR_COMPRESSION_NONE));
    TRY(exr_set_tile_descriptor(x, part, 3 * (uint32_t)s->n_theta, (uint32_t)s->n_phi, EXR_TILE_ONE_LEVEL,
                                EXR_TILE_ROUND_DOWN));
    TRY(exr_add_channel(x, part, ILF_INTERLEAVED_CHANNEL,
                        s->type == ILF_HALF ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC,
                        1, 1));
    return exr_attr_set_int(x, part, ILF_INTERLEAVED_ATTRIBUTE, 1);
}

static exr_result_t write_header(ilf_writer *w, exr_compression_t compression)
{
    const ilf_spec *s = &w->spec;
    const exr_pixel_type_t type = s->type == ILF_HALF ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
    const exr_attr_box2i_t window = {{{{0, 0}}}, {{{s->n_u * s->n_theta - 1, s->n_v * s->n_phi - 1}}}};
    const exr_attr_v2f_t centre = {{{0, 0}}};
    exr_context_t x = w->exr;
    exr_result_t r;
    int part;

    TRY(exr_add_part(x, "probes", EXR_STORAGE_TILED, &part));
    TRY(exr_initialize_required_attr(x, 0, &window, &window, 1.f, &centre, 1.f, EXR_LINEORDER_INCREASING_Y,
                                     compression));
    TRY(exr_set_tile_descriptor(x, 0, (uint32_t)s->n_theta, (uint32_t)s->n_phi, EXR_TILE_ONE_LEVEL,
                                EXR_TILE_ROUND_DOWN));
    TRY(exr_add_channel(x, 0, "B", type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1));
    TRY(exr_add_channel(x, 0, "G", type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1));
    TRY(exr_add_channel(x, 0, "R", type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1));
    TRY(exr_attr_set_int(x, 0, "ilf:version", s->n_lamps ? ILF_FILE_VERSION_LAMPS : ILF_FILE_VERSION));
    TRY(set_vector(x, "ilf:origin", s->origin));
    TRY(set_vector(x, "ilf:U", s->U));
    TRY(set_vector(x, "ilf:V", s->V));
    TRY(exr_attr_set_float(x, 0, "ilf:polarMax", (float)s->polar_max));
    if (s->polar_valid > 0) TRY(exr_attr_set_float(x, 0, "ilf:polarValid", (float)s->polar_valid));
    if (s->white_luminance > 0) TRY(exr_attr_set_float(x, 0, "whiteLuminance", (float)s->white_luminance));
    if (s->comments) TRY(exr_attr_set_string(x, 0, "comments", s->comments));
    if (s->owner) TRY(exr_attr_set_string(x, 0, "owner", s->owner));
    if (s->cap_date) TRY(exr_attr_set_string(x, 0, "capDate", s->cap_date));
    if (s->interleave) TRY(add_interleaved(x, s, &window));
    if (s->n_lamps) TRY(ilf_declare_lamps(x, s, &window));
    return exr_write_header(x);
}
#undef TRY

ilf_status ilf_spec_check(const ilf_spec *spec, ilf_error *err)
{
    exr_compression_t compression;
    return check_spec(spec->name ? spec->name : "light field", spec, &compression, err);
}

ilf_status ilf_writer_open(ilf_writer **writer, const char *path, const ilf_spec *spec, ilf_error *err)
{
    exr_compression_t compression = EXR_COMPRESSION_NONE;
    const char *name = spec->name ? spec->name : path;
    const ilf_status st = check_spec(name, spec, &compression, err);

    if (st != ILF_OK) return st;
    ilf_writer *w = calloc(1, sizeof *w);
    if (!w || !(w->path = strdup(name)) || !(w->file = strdup(path)) ||
        (spec->type == ILF_HALF && !(w->half = malloc((size_t)spec->n_theta * (size_t)spec->n_phi * 6))) ||
        (spec->tolerance > 0 && !(w->rounded = malloc((size_t)spec->n_theta * (size_t)spec->n_phi * 12)))) {
        ilf_writer_abort(w);
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory", name);
    }
    w->spec = *spec;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = keep_words;
    at_work = w;
    exr_result_t r = exr_start_write(&w->exr, path, EXR_WRITE_FILE_DIRECTLY, &init);
    if (r != EXR_ERR_SUCCESS) w->exr = NULL;
    else r = write_header(w, compression);
    if (r != EXR_ERR_SUCCESS) {
        const ilf_status bad = failed(w, r, err);
        ilf_writer_abort(w);
        return bad;
    }
    *writer = w;
    return ILF_OK;
}

/* Luminance that falls on the plane. */
static double irradiance(const float *rgb, const ilf_spec *s)
{
    const double step = s->polar_max / s->n_phi;
    double e = 0;

    for (int y = 0; y < s->n_phi && y * step < ILF_PI / 2; y++, rgb += 3 * (size_t)s->n_theta) {
        const double lo = sin(y * step), hi = sin(fmin((y + 1) * step, ILF_PI / 2)); /* integral of cos sin */
        double row = 0;
        for (int x = 0; x < s->n_theta; x++) row += ilf_luminance(rgb + 3 * (size_t)x);
        e += row * (hi * hi - lo * lo) * ILF_PI / s->n_theta;
    }
    return e;
}

static void add_loss(loss_sums *l, const float *rgb, const float *rounded, const ilf_spec *s, int i, int j)
{
    const size_t n = (size_t)s->n_theta * (size_t)s->n_phi * 3;
    const double before = irradiance(rgb, s), after = irradiance(rounded, s);
    const float least =
        s->type == ILF_HALF ? 0x1p-14f : 0x1p-126f; /* below it the type's own steps are coarser */

    for (size_t k = 0; k < n; k++)
        if (fabsf(rgb[k]) >= least)
            l->most.texel = fmax(l->most.texel, fabs((double)rounded[k] / (double)rgb[k] - 1));
    l->before += before, l->after += after;
    if (!(before > 0)) return;
    const double change = after / before - 1;
    l->square += change * change, l->lit++;
    if (fabs(change) > fabs(l->most.worst)) l->most.worst = change, l->most.worst_i = i, l->most.worst_j = j;
}

static void tell_loss(ilf_loss *loss, const loss_sums *l)
{
    *loss = l->most;
    loss->rms = l->lit ? sqrt(l->square / (double)l->lit) : 0;
    loss->mean = l->before > 0 ? l->after / l->before - 1 : 0;
}

/* The probe's texels rounded, and what that does. */
static const float *round_probe(ilf_writer *w, const float *rgb, int i, int j)
{
    const size_t n = (size_t)w->spec.n_theta * (size_t)w->spec.n_phi * 3;

    memcpy(w->rounded, rgb, n * sizeof *rgb);
    ilf_round(w->rounded, n, w->spec.type, w->spec.tolerance);
    if (w->spec.loss) add_loss(&w->loss, rgb, w->rounded, &w->spec, i, j);
    return w->rounded;
}

/* Refuse what a file must not hold; fill w->half where the file holds halves. */
static ilf_status take_texels(ilf_writer *w, const float *rgb, int i, int j, ilf_error *err)
{
    const size_t n = (size_t)w->spec.n_theta * (size_t)w->spec.n_phi * 3;

    for (size_t k = 0; k < n; k++) {
        const size_t x = k / 3 % (size_t)w->spec.n_theta, y = k / 3 / (size_t)w->spec.n_theta;
        if (!isfinite(rgb[k]))
            return ilf_fail(err, ILF_ERR_VALUE,
                            "%s: probe (%d,%d), pixel (%zu,%zu): expected a finite value, found %g", w->path,
                            i, j, x, y, (double)rgb[k]);
        if (w->half) {
            if (fabsf(rgb[k]) > 65504.f)
                return ilf_fail(err, ILF_ERR_VALUE,
                                "%s: probe (%d,%d), pixel (%zu,%zu): expected a value that a half holds "
                                "(65504), found %g",
                                w->path, i, j, x, y, (double)rgb[k]);
            w->half[k] = half_from_float(rgb[k]);
        }
    }
    return ILF_OK;
}

ilf_status ilf_writer_probe(ilf_writer *w, const float *rgb, ilf_error *err)
{
    const int i = (int)(w->next % w->spec.n_u), j = (int)(w->next / w->spec.n_u);
    const int bytes = w->half ? 2 : 4;
    exr_encode_pipeline_t e = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_compress_fn *kept = NULL;
    exr_chunk_info_t chunk;

    if (j >= w->spec.n_v)
        return ilf_fail(err, ILF_ERR_ARG, "%s: expected %dx%d probes, found more", w->path, w->spec.n_u,
                        w->spec.n_v);
    if (w->rounded) rgb = round_probe(w, rgb, i, j);
    const ilf_status st = take_texels(w, rgb, i, j, err);
    if (st != ILF_OK) return st;
    const unsigned char *from = w->half ? (const unsigned char *)w->half : (const unsigned char *)rgb;

    at_work = w;
    exr_result_t r = exr_write_tile_chunk_info(w->exr, 0, i, j, 0, 0, &chunk);
    if (r == EXR_ERR_SUCCESS) r = exr_encoding_initialize(w->exr, 0, &chunk, &e);
    if (r == EXR_ERR_SUCCESS) {
        for (int c = 0; c < e.channel_count; c++) {
            exr_coding_channel_info_t *ch = &e.channels[c];
            const int k = ch->channel_name[0] == 'R' ? 0 : ch->channel_name[0] == 'G' ? 1 : 2;

            ch->encode_from_ptr = from + k * bytes;
            ch->user_bytes_per_element = (int16_t)bytes;
            ch->user_data_type = w->half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
            ch->user_pixel_stride = 3 * bytes;
            ch->user_line_stride = 3 * bytes * w->spec.n_theta;
        }
        r = exr_encoding_choose_default_routines(w->exr, 0, &e);
        exr_keep_incompressible(&e, &kept);
        if (r == EXR_ERR_SUCCESS) r = exr_encoding_run(w->exr, 0, &e);
        exr_encoding_destroy(w->exr, &e);
    }
    if (r != EXR_ERR_SUCCESS) return failed(w, r, err);
    w->next++;
    return ILF_OK;
}

/* Texels of a raw planar tile, B G R row by row, each one's R G B together. */
static void together(unsigned char *to, const unsigned char *from, size_t n_theta, size_t n_phi, size_t size)
{
    for (size_t y = 0; y < n_phi; y++, to += 3 * n_theta * size)
        for (size_t c = 3; c-- > 0; from += n_theta * size)
            for (size_t x = 0; x < n_theta; x++) memcpy(to + (3 * x + c) * size, from + x * size, size);
}

/* The first part's tiles lie in the file as they came, one after the other to its end: a part's tiles must
 * all be written before the next part's, so they are read from there again. */
static ilf_status copy_tiles(ilf_writer *w, int fd, unsigned char *tile, unsigned char *out, ilf_error *err)
{
    const size_t n_theta = (size_t)w->spec.n_theta, n_phi = (size_t)w->spec.n_phi, size = w->half ? 2 : 4;
    const uint64_t bytes = 3 * n_theta * n_phi * size, head = EXR_TILE_HEAD_SEVERAL;
    const int64_t n = (int64_t)w->spec.n_u * w->spec.n_v;
    struct stat st;

    if (fstat(fd, &st) != 0) return ilf_fail(err, ILF_ERR_IO, "%s: %s", w->path, strerror(errno));
    const uint64_t end = (uint64_t)st.st_size, all = (uint64_t)n * (head + bytes);
    for (int64_t k = 0; k < n; k++) {
        const uint32_t i = (uint32_t)(k % w->spec.n_u), j = (uint32_t)(k / w->spec.n_u);
        const int there =
            end >= all && exr_bytes_at(fd, tile, head + bytes, end - all + (uint64_t)k * (head + bytes)) == 0;
        const exr_tile t = there ? exr_tile_head(tile, 1) : (exr_tile){0};
        if (!there || t.part != 0 || t.x != i || t.y != j || t.size != bytes)
            return ilf_fail(err, ILF_ERR_IO,
                            "%s: probe (%u,%u): expected to read what was written, found something else",
                            w->path, i, j);
        together(out, tile + head, n_theta, n_phi, size);
        const exr_result_t r = exr_write_tile_chunk(w->exr, 1, (int)i, (int)j, 0, 0, out, bytes);
        if (r != EXR_ERR_SUCCESS) return failed(w, r, err);
    }
    return ILF_OK;
}

static ilf_status write_interleaved(ilf_writer *w, ilf_error *err)
{
    const size_t bytes = (size_t)w->spec.n_theta * (size_t)w->spec.n_phi * 12;
    unsigned char *tile = malloc(EXR_TILE_HEAD_SEVERAL + bytes), *out = malloc(bytes);
    const int fd = tile && out ? open(w->file, O_RDONLY | O_CLOEXEC) : -1;
    ilf_status st;

    if (!tile || !out) st = ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for a probe", w->path);
    else
        st = fd >= 0 ? copy_tiles(w, fd, tile, out, err)
                     : ilf_fail(err, ILF_ERR_IO, "%s: %s", w->path, strerror(errno));
    if (fd >= 0) close(fd);
    free(tile);
    free(out);
    return st;
}

ilf_status ilf_writer_close(ilf_writer *w, ilf_error *err)
{
    ilf_status st = ILF_OK;

    if (w->next < (int64_t)w->spec.n_u * w->spec.n_v)
        st = ilf_fail(err, ILF_ERR_ARG, "%s: expected %lld probes, found %lld", w->path,
                      (long long)w->spec.n_u * w->spec.n_v, (long long)w->next);
    else {
        at_work = w;
        exr_result_t r = EXR_ERR_SUCCESS;
        if (w->spec.interleave) st = write_interleaved(w, err);
        if (st == ILF_OK && w->spec.n_lamps)
            r = ilf_write_lamps(w->exr, &w->spec, w->spec.interleave ? 2 : 1);
        if (r != EXR_ERR_SUCCESS) st = failed(w, r, err);
        r = exr_finish(&w->exr);
        w->exr = NULL;
        if (st == ILF_OK && r != EXR_ERR_SUCCESS) st = failed(w, r, err);
        if (st == ILF_OK && w->spec.loss) tell_loss(w->spec.loss, &w->loss);
    }
    ilf_writer_abort(w);
    return st;
}

void ilf_writer_abort(ilf_writer *w)
{
    if (!w) return;
    at_work = NULL;
    if (w->exr) exr_finish(&w->exr);
    free(w->half);
    free(w->rounded);
    free(w->file);
    free(w->path);
    free(w);
}
