/*
 * ilf_file.c - open and validate an incident light field file (docs/FORMAT.md, sections 1 and 4).
 *
 * Only the header, the table of tile offsets, and the lamps of a file of version 2 are read.  The table is checked against the
 * file's length, so that a truncated file is refused at once and not in the middle of a
 * picture.  Further parts: ilf_layout.c, ilf_lampread.c.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "exr/exr_bytes.h"
#include "exr/exr_compression.h"
#include "exr/exr_tiles.h"
#include "ilf_lampfile.h"

/* ---- OpenEXR's view of the file ----------------------------------------------------------- */

static int64_t read_at(exr_const_context_t ctxt, void *user, void *buffer, uint64_t size, uint64_t offset,
                       exr_stream_error_func_ptr_t error_cb)
{
    const ilf *f = user;
    char *to = buffer;
    uint64_t done = 0;

    while (done < size) {
        const ssize_t n = pread(f->fd, to + done, (size_t)(size - done), (off_t)(offset + done));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            error_cb(ctxt, EXR_ERR_READ_IO, "%s", strerror(errno));
            return -1;
        }
        if (n == 0) break;
        done += (uint64_t)n;
    }
    return (int64_t)done;
}

static int64_t file_size(exr_const_context_t ctxt, void *user)
{
    (void)ctxt;
    return ((const ilf *)user)->info.file_bytes;
}

/* A thread's own: probes are read by several at once. */
ilf_error *ilf_exr_words(void)
{
    static _Thread_local ilf_error words;

    return &words;
}

/* Keep OpenEXR's first words: they are the cause, later ones the consequence. */
static void keep_words(exr_const_context_t ctxt, exr_result_t code, const char *msg)
{
    ilf_error *words = ilf_exr_words();

    (void)ctxt;
    if (!words->text[0])
        ilf_fail(words, ILF_ERR_FORMAT, "%s", msg ? msg : exr_get_default_error_message(code));
}

static ilf_status exr_failed(const ilf *f, exr_result_t code, const char *what, ilf_error *err)
{
    const char *words = ilf_exr_words()->text;

    return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: %s", f->path, what,
                    words[0] ? words : exr_get_default_error_message(code));
}

/* ---- attributes --------------------------------------------------------------------------- */

ilf_status ilf_attribute(const ilf *f, const char *name, exr_attribute_type_t type, const char *type_name,
                         int optional, const exr_attribute_t **attr, ilf_error *err)
{
    *attr = NULL;
    if (exr_get_attribute_by_name(f->exr, 0, name, attr) != EXR_ERR_SUCCESS || !*attr) {
        *attr = NULL;
        if (optional) return ILF_OK;
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected an attribute of type %s, found none", f->path,
                        name, type_name);
    }
    if ((*attr)->type != type)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected an attribute of type %s, found type %s",
                        f->path, name, type_name, (*attr)->type_name);
    return ILF_OK;
}

static ilf_status vector_attribute(const ilf *f, const char *name, float v[3], ilf_error *err)
{
    const exr_attribute_t *a;
    const ilf_status st = ilf_attribute(f, name, EXR_ATTR_V3F, "v3f", 0, &a, err);

    if (st != ILF_OK) return st;
    v[0] = a->v3f->x, v[1] = a->v3f->y, v[2] = a->v3f->z;
    return ILF_OK;
}

static ilf_status read_attributes(ilf *f, ilf_error *err)
{
    const exr_attribute_t *a;
    ilf_status st;

    if ((st = ilf_attribute(f, "ilf:version", EXR_ATTR_INT, "int", 0, &a, err)) != ILF_OK) return st;
    if (a->i != ILF_FILE_VERSION && a->i != ILF_FILE_VERSION_LAMPS)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: ilf:version: expected %d or %d, found %d", f->path,
                        ILF_FILE_VERSION, ILF_FILE_VERSION_LAMPS, a->i);
    f->info.version = a->i;
    if ((st = vector_attribute(f, "ilf:origin", f->info.origin, err)) != ILF_OK) return st;
    if ((st = vector_attribute(f, "ilf:U", f->info.U, err)) != ILF_OK) return st;
    if ((st = vector_attribute(f, "ilf:V", f->info.V, err)) != ILF_OK) return st;
    if ((st = ilf_attribute(f, "ilf:polarMax", EXR_ATTR_FLOAT, "float", 0, &a, err)) != ILF_OK) return st;
    f->info.polar_max = f->info.polar_valid = (double)a->f;
    if ((st = ilf_attribute(f, "ilf:polarValid", EXR_ATTR_FLOAT, "float", 1, &a, err)) != ILF_OK) return st;
    if (a) f->info.polar_valid = (double)a->f;
    if ((st = ilf_check_polar(f->info.polar_max, f->info.polar_valid, f->path, err)) != ILF_OK) return st;
    f->info.polar_valid = fmin(f->info.polar_valid, f->info.polar_max);
    f->full_sphere = ilf_is_full_sphere(f->info.polar_max);

    double o[3], u[3], v[3];
    for (int c = 0; c < 3; c++) {
        o[c] = (double)f->info.origin[c];
        u[c] = (double)f->info.U[c];
        v[c] = (double)f->info.V[c];
    }
    return ilf_check_plane(&f->frame, o, u, v, f->path, err);
}

/* ---- geometry of the image ---------------------------------------------------------------- */

static ilf_status read_layout(ilf *f, ilf_error *err)
{
    exr_storage_t storage;
    exr_attr_box2i_t dw;
    uint32_t tw, th;
    exr_tile_level_mode_t level;
    exr_tile_round_mode_t round;
    exr_compression_t compression;

    if (exr_get_storage(f->exr, 0, &storage) != EXR_ERR_SUCCESS || storage != EXR_STORAGE_TILED)
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: tiles: expected a tiled image, found scan lines or deep data", f->path);
    if (exr_get_tile_descriptor(f->exr, 0, &tw, &th, &level, &round) != EXR_ERR_SUCCESS)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: tiles: expected a tile description, found none", f->path);
    if (level != EXR_TILE_ONE_LEVEL)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: tiles: expected ONE_LEVEL, found a multi-resolution image",
                        f->path);
    if (exr_get_data_window(f->exr, 0, &dw) != EXR_ERR_SUCCESS)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: dataWindow: expected one, found none", f->path);
    if (dw.min.x != 0 || dw.min.y != 0)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: dataWindow: expected to begin at (0,0), found (%d,%d)",
                        f->path, dw.min.x, dw.min.y);
    const int64_t w = (int64_t)dw.max.x + 1, h = (int64_t)dw.max.y + 1;
    if (tw < 1 || th < 1 || tw > ILF_MAX_SIDE || th > ILF_MAX_SIDE)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: tiles: expected a size from 1 to %d, found %ux%u", f->path,
                        ILF_MAX_SIDE, tw, th);
    if (w < 1 || h < 1 || w % tw || h % th)
        return ilf_fail(
            err, ILF_ERR_FORMAT,
            "%s: dataWindow: expected whole tiles of %ux%u (one tile is one probe), found %lldx%lld", f->path,
            tw, th, (long long)w, (long long)h);
    f->info.n_theta = (int)tw, f->info.n_phi = (int)th;
    f->info.n_u = (int)(w / tw), f->info.n_v = (int)(h / th);
    if (exr_get_compression(f->exr, 0, &compression) != EXR_ERR_SUCCESS ||
        !exr_compression_name((int)compression))
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: compression: expected one that OpenEXR knows, found number %d", f->path,
                        (int)compression);
    f->info.compression = exr_compression_name((int)compression);
    f->is_dwa = compression == EXR_COMPRESSION_DWAA || compression == EXR_COMPRESSION_DWAB;
    return ILF_OK;
}

/* Channels R, G, B and their places in a row: OpenEXR keeps them in alphabetical order. */
static ilf_status read_channels(ilf *f, ilf_error *err)
{
    static const char *const names[3] = {"R", "G", "B"};
    const exr_attr_chlist_t *list;
    int found[3] = {-1, -1, -1}, half = 0;

    if (exr_get_channels(f->exr, 0, &list) != EXR_ERR_SUCCESS || list->num_channels != 3)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: channels: expected R, G, B and no other", f->path);
    for (int k = 0; k < 3; k++) {
        const exr_attr_chlist_entry_t *e = &list->entries[k];

        for (int c = 0; c < 3; c++)
            if (!strcmp(e->name.str, names[c])) found[c] = k;
        if (e->pixel_type != EXR_PIXEL_HALF && e->pixel_type != EXR_PIXEL_FLOAT)
            return ilf_fail(err, ILF_ERR_FORMAT, "%s: channels: expected HALF or FLOAT, found UINT in %s",
                            f->path, e->name.str);
        if (e->x_sampling != 1 || e->y_sampling != 1)
            return ilf_fail(err, ILF_ERR_FORMAT, "%s: channels: expected no subsampling, found some in %s",
                            f->path, e->name.str);
        half += e->pixel_type == EXR_PIXEL_HALF;
    }
    for (int c = 0; c < 3; c++)
        if (found[c] < 0)
            return ilf_fail(err, ILF_ERR_FORMAT, "%s: channels: expected R, G, B, found no %s", f->path,
                            names[c]);
    f->raw.bytes = 0;
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++)
            if (found[c] == k) {
                f->raw.start[c] = f->raw.bytes;
                f->raw.is_half[c] = list->entries[k].pixel_type == EXR_PIXEL_HALF;
                f->raw.bytes += (size_t)f->info.n_theta * (f->raw.is_half[c] ? 2 : 4);
            }
    f->uniform = half == 0 || half == 3;
    f->is_half = half == 3;
    f->info.type = half == 3 ? ILF_HALF : ILF_FLOAT;
    f->texel_bytes = f->is_half ? 2 : 4;
    f->row_bytes = 3 * (size_t)f->info.n_theta * f->texel_bytes;
    if ((int64_t)f->row_bytes > ILF_MAX_PROBE_BYTES / f->info.n_phi)
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: tiles: expected probes of at most %lld bytes, found %dx%d texels", f->path,
                        (long long)ILF_MAX_PROBE_BYTES, f->info.n_theta, f->info.n_phi);
    f->probe_bytes = f->row_bytes * (size_t)f->info.n_phi;
    return ILF_OK;
}

/* ---- table of tiles ----------------------------------------------------------------------- */

/* Every tile must begin inside the file and the one that begins last must end there too. */
static ilf_status check_tiles(const ilf *f, ilf_error *err)
{
    const int64_t n = (int64_t)f->info.n_u * f->info.n_v;
    int64_t k = 0;
    const exr_tiles state = exr_tiles_check(&k, f->fd, (uint64_t)f->info.file_bytes, n);

    switch (state) {
    case EXR_TILES_SOUND: break;
    case EXR_TILES_NO_TABLE:
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: tiles: expected a table of %lld tiles, found the end of the file", f->path,
                        (long long)n);
    case EXR_TILES_NO_MEMORY:
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for a table of %lld tiles", f->path,
                        (long long)n);
    case EXR_TILES_UNREADABLE:
        return ilf_fail(err, ILF_ERR_IO, "%s: tiles: the table can't be read", f->path);
    case EXR_TILES_UNFINISHED:
    case EXR_TILES_OUTSIDE:
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: probe (%lld,%lld): expected %s, found %s", f->path,
                        (long long)(k % f->info.n_u), (long long)(k / f->info.n_u), "a tile inside the file",
                        state == EXR_TILES_UNFINISHED ? "none (unfinished file)"
                                                      : "one outside (truncated file)");
    case EXR_TILES_CUT:
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: tiles: expected the last tile to end inside the file, found it truncated",
                        f->path);
    }
    return ILF_OK;
}

/* ---- open, close -------------------------------------------------------------------------- */

void ilf_close(ilf *f)
{
    if (!f) return;
    if (f->probes) {
        const int64_t n = (int64_t)f->info.n_u * f->info.n_v;
        for (int64_t k = 0; k < n; k++) free(f->probes[k].decoded);
        free(f->probes);
    }
    free(f->pix);
    ilf_free_lamps(f->lamps, f->n_lamps);
    free(f->lamp_balls);
    ilf_memory_free(f);
    pthread_mutex_destroy(&f->lock);
    pthread_mutex_destroy(&f->dwa_lock);
    pthread_cond_destroy(&f->loaded);
    if (f->exr) exr_finish(&f->exr);
    if (f->map) munmap((void *)(uintptr_t)f->map, (size_t)f->info.file_bytes);
    if (f->fd >= 0) close(f->fd);
    free(f->path);
    free(f);
}

static ilf_status open_file(ilf *f, ilf_error *err)
{
    unsigned char found[4];

    f->fd = open(f->path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
    if (f->fd < 0 || fstat(f->fd, &f->st) != 0)
        return ilf_fail(err, ILF_ERR_IO, "%s: can't be opened: %s", f->path, strerror(errno));
    if (!S_ISREG(f->st.st_mode))
        return ilf_fail(err, ILF_ERR_IO, "%s: expected an OpenEXR file, found no regular file", f->path);
    f->info.file_bytes = f->st.st_size;
    if (exr_bytes_at(f->fd, found, 4, 0) != 0 || !exr_is_magic(found, 4))
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: expected an OpenEXR file, found something else", f->path);
    char words[128];
    if (exr_foreign_compression(words, sizeof words,
                                exr_stated_compression(f->fd, (uint64_t)f->info.file_bytes)))
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: compression: expected one that this program reads, %s",
                        f->path, words);

    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.user_data = f;
    init.read_fn = read_at;
    init.size_fn = file_size;
    init.error_handler_fn = keep_words;
    init.max_image_width = init.max_image_height = 0;
    ilf_exr_words()->text[0] = 0;
    const exr_result_t r = exr_start_read(&f->exr, f->path, &init);
    if (r != EXR_ERR_SUCCESS) {
        f->exr = NULL;
        return exr_failed(f, r, "header", err);
    }
    return ILF_OK;
}

static ilf_status make_probes(ilf *f, ilf_error *err)
{
    const size_t n = (size_t)f->info.n_u * (size_t)f->info.n_v;

    f->probes = calloc(n, sizeof *f->probes);
    f->pix = calloc(n, sizeof *f->pix);
    if (!f->probes || !f->pix)
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for %zu probes", f->path, n);
    void *m = mmap(NULL, (size_t)f->info.file_bytes, PROT_READ, MAP_SHARED, f->fd, 0);
    if (m != MAP_FAILED) {
        f->map = m;
        madvise(m, (size_t)f->info.file_bytes, MADV_RANDOM); /* no read-ahead past what is touched */
    }
    ilf_fail_changed(f, &f->fault);
    ilf_choose_layout(f);
    return ILF_OK;
}

ilf_status ilf_open(ilf **field, const char *path, ilf_error *err)
{
    ilf *f = calloc(1, sizeof *f);
    ilf_status st;

    if (!f || !(f->path = strdup(path))) {
        free(f);
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory", path);
    }
    f->fd = -1;
    pthread_mutex_init(&f->lock, NULL);
    pthread_mutex_init(&f->dwa_lock, NULL);
    pthread_cond_init(&f->loaded, NULL);
    if ((st = open_file(f, err)) != ILF_OK || (st = read_layout(f, err)) != ILF_OK ||
        (st = read_channels(f, err)) != ILF_OK || (st = read_attributes(f, err)) != ILF_OK ||
        (st = check_tiles(f, err)) != ILF_OK ||
        (f->info.version == ILF_FILE_VERSION_LAMPS && (st = ilf_read_lamps(f, err)) != ILF_OK) ||
        (f->n_lamps && (st = ilf_bound_lamps(f, err)) != ILF_OK) || (st = make_probes(f, err)) != ILF_OK) {
        ilf_close(f);
        return st;
    }
    *field = f;
    return ILF_OK;
}

const ilf_info *ilf_get_info(const ilf *f)
{
    return &f->info;
}

const ilf_luminaire *ilf_get_luminaires(int *n, const ilf *f)
{
    *n = f->n_lamps;
    return f->lamps;
}

static const char *text_of(const ilf *f, const char *name)
{
    const exr_attribute_t *a;

    return ilf_attribute(f, name, EXR_ATTR_STRING, "string", 1, &a, NULL) == ILF_OK && a ? a->string->str
                                                                                         : NULL;
}

void ilf_get_notes(ilf_notes *notes, const ilf *f)
{
    const exr_attribute_t *a;
    const int stated = ilf_attribute(f, "whiteLuminance", EXR_ATTR_FLOAT, "float", 1, &a, NULL) == ILF_OK &&
                       a && isfinite(a->f) && a->f > 0;

    notes->comments = text_of(f, "comments");
    notes->owner = text_of(f, "owner");
    notes->cap_date = text_of(f, "capDate");
    notes->white_luminance = stated ? (double)a->f : 0;
}

const ilf_frame *ilf_get_frame(const ilf *f)
{
    return &f->frame;
}

const char *ilf_get_path(const ilf *f)
{
    return f->path;
}

const char *ilf_fault(const ilf *f, const void *address)
{
    const uintptr_t at = (uintptr_t)address, map = (uintptr_t)f->map;

    return f->map && at >= map && at - map < (uintptr_t)f->info.file_bytes ? f->fault.text : NULL;
}

void ilf_get_usage(ilf_usage *usage, const ilf *f)
{
    pthread_mutex_t *lock = (pthread_mutex_t *)(uintptr_t)&f->lock; /* counting is not a change */

    pthread_mutex_lock(lock);
    *usage = f->usage;
    pthread_mutex_unlock(lock);
}
