/*
 * ilf_probe.c - bring in one probe, on the first lookup that needs it.
 *
 * A tile that lies uncompressed in the file is used where it is, in the mapped file: several
 * processes then share one copy, and a render's memory is the probes that it touches.  Where the file has a
 * second part with the same texels interleaved, that one is used, after it has been compared with the first
 * part, which counts. Any other tile is decoded into memory, by the thread that needs it first, while others go on (ilf_memory.c bounds that
 * memory). Either way the texels are checked once.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "ilf_internal.h"

/* Where texel bytes say NaN or infinity: all exponent bits set. */
static int64_t first_bad(const unsigned char *pix, size_t bytes, int is_half)
{
    if (is_half) {
        for (size_t k = 0; k < bytes; k += 2) {
            uint16_t h;
            memcpy(&h, pix + k, sizeof h);
            if ((h & 0x7c00u) == 0x7c00u) return (int64_t)k;
        }
    } else {
        for (size_t k = 0; k < bytes; k += 4) {
            uint32_t v;
            memcpy(&v, pix + k, sizeof v);
            if ((v & 0x7f800000u) == 0x7f800000u) return (int64_t)k;
        }
    }
    return -1;
}

/* Mean of a row: what the value tends to at the pole beside it. */
static void row_mean(float mean[3], const ilf *f, const unsigned char *row)
{
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int x = 0; x < f->info.n_theta; x++)
            sum += (double)ilf_texel(f, row + f->chan_offset[c] + (size_t)x * f->pixel_bytes);
        mean[c] = (float)(sum / f->info.n_theta);
    }
}

static ilf_status decode(ilf *f, const exr_chunk_info_t *chunk, unsigned char *pix, const char *where,
                         ilf_error *err)
{
    exr_decode_pipeline_t d = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t r = exr_decoding_initialize(f->exr, 0, chunk, &d);

    if (r == EXR_ERR_SUCCESS) {
        for (int c = 0; c < d.channel_count; c++) {
            exr_coding_channel_info_t *ch = &d.channels[c];
            const int k = ch->channel_name[0] == 'R' ? 0 : ch->channel_name[0] == 'G' ? 1 : 2;

            ch->decode_to_ptr = pix + f->chan_offset[k];
            ch->user_bytes_per_element = (int16_t)f->texel_bytes;
            ch->user_data_type = f->is_half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
            ch->user_pixel_stride = (int32_t)f->pixel_bytes;
            ch->user_line_stride = (int32_t)f->row_bytes;
        }
        r = exr_decoding_choose_default_routines(f->exr, 0, &d);
        if (r == EXR_ERR_SUCCESS) r = exr_decoding_run(f->exr, 0, &d);
    }
    exr_decoding_destroy(f->exr, &d);
    if (r == EXR_ERR_SUCCESS) return ILF_OK;
    return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected a whole tile, found: %s", f->path, where,
                    ilf_exr_words()->text[0] ? ilf_exr_words()->text : exr_get_default_error_message(r));
}

/* The file must be the one that was opened: replaced by rename it still is (the old file lives on
 * while it is open), written in place it is not. */
ilf_status ilf_check_unchanged(const ilf *f, ilf_error *err)
{
    struct stat st;

    if (fstat(f->fd, &st) != 0) return ilf_fail(err, ILF_ERR_IO, "%s: %s", f->path, strerror(errno));
    if (st.st_size != f->st.st_size || st.st_mtim.tv_sec != f->st.st_mtim.tv_sec ||
        st.st_mtim.tv_nsec != f->st.st_mtim.tv_nsec)
        return ilf_fail_changed(f, err);
    return ILF_OK;
}

ilf_status ilf_fail_changed(const ilf *f, ilf_error *err)
{
    return ilf_fail(
        err, ILF_ERR_CHANGED,
        "%s: expected the file as it was opened, found it changed (replace a light field in use by "
        "renaming a new one to its name)",
        f->path);
}

/* Where part's tile (i, j) is; fails in one line if it is not inside the file. */
static ilf_status find_tile(ilf *f, int part, int i, int j, exr_chunk_info_t *chunk, const char *where,
                            ilf_error *err)
{
    ilf_exr_words()->text[0] = 0;
    const exr_result_t r = exr_read_tile_chunk_info(f->exr, part, i, j, 0, 0, chunk);
    if (r != EXR_ERR_SUCCESS)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected a tile, found: %s", f->path, where,
                        ilf_exr_words()->text[0] ? ilf_exr_words()->text : exr_get_default_error_message(r));
    if (chunk->unpacked_size == 0 || chunk->data_offset > (uint64_t)f->info.file_bytes ||
        chunk->packed_size > (uint64_t)f->info.file_bytes - chunk->data_offset)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected a tile inside the file, found it truncated",
                        f->path, where);
    return ILF_OK;
}

/* Not compressed, be it that compression did not make it smaller: of which OpenEXR's core library knows
 * nothing for B44 (3.1). */
static int is_raw(const ilf *f, const exr_chunk_info_t *chunk)
{
    const size_t bytes = f->raw.bytes * (size_t)f->info.n_phi;

    return chunk->packed_size == bytes && chunk->unpacked_size == bytes;
}

static ilf_status decode_dwa(ilf *f, int i, int j, unsigned char *pix, ilf_error *err)
{
    pthread_mutex_lock(&f->dwa_lock);
    const ilf_status st = ilf_decode_dwa(f, i, j, pix, err);
    pthread_mutex_unlock(&f->dwa_lock);
    return st;
}

/* Decode a tile of the first part into *own, or, where that is NULL, memory that becomes it. */
static ilf_status decode_tile(ilf *f, int i, int j, const exr_chunk_info_t *chunk, const unsigned char **pix,
                              void **own, const char *where, ilf_error *err)
{
    unsigned char *to = *own ? *own : malloc(TEXEL_HEAD + f->probe_bytes);

    *own = to;
    if (!to)
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: %s: no memory for %zu bytes", f->path, where,
                        f->probe_bytes);
    memset(to, 0, TEXEL_HEAD);
    *pix = to + TEXEL_HEAD;
    if (is_raw(f, chunk))
        return ilf_copy_texels(f, to + TEXEL_HEAD, chunk->data_offset)
                   ? ILF_OK
                   : ilf_fail(err, ILF_ERR_IO, "%s: %s: can't be read", f->path, where);
    return f->is_dwa ? decode_dwa(f, i, j, to + TEXEL_HEAD, err)
                     : decode(f, chunk, to + TEXEL_HEAD, where, err);
}

/* Texels of probe k, checked: in the mapped file, or decoded into *own (the caller's memory, or NULL: then it is taken).  The caller
 * frees *own where it fails, too. */
static ilf_status get_tile(ilf *f, int64_t k, const unsigned char **pix, void **own, ilf_error *err)
{
    const int i = (int)(k % f->info.n_u), j = (int)(k / f->info.n_u);
    probe *p = &f->probes[k];
    exr_chunk_info_t chunk, second;
    char where[64];
    ilf_status st = ilf_check_unchanged(f, err);

    *pix = NULL;
    (void)!snprintf(where, sizeof where, "probe (%d,%d)", i, j);
    if (st == ILF_OK) st = find_tile(f, 0, i, j, &chunk, where, err);
    if (st != ILF_OK) return st;
    if (f->second_part) {
        /* where it is not what the first part says, it was changed without it: then it does not count */
        if (is_raw(f, &chunk) && find_tile(f, f->second_part, i, j, &second, where, NULL) == ILF_OK &&
            is_raw(f, &second) &&
            (p->checked || ilf_same_texels(f, f->map + second.data_offset, chunk.data_offset)))
            *pix = f->map + second.data_offset;
    } else if (f->in_place) {
        if (!is_raw(f, &chunk))
            return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected a tile of %zu bytes, found %llu", f->path,
                            where, f->probe_bytes, (unsigned long long)chunk.packed_size);
        *pix = f->map + chunk.data_offset;
    }
    if (*pix && p->checked) return ILF_OK;
    if (!*pix && (st = decode_tile(f, i, j, &chunk, pix, own, where, err)) != ILF_OK) return st;
    const int64_t bad = first_bad(*pix, f->probe_bytes, f->is_half);
    if (bad >= 0) {
        const size_t y = (size_t)bad / f->row_bytes, rest = (size_t)bad % f->row_bytes;
        return ilf_fail(err, ILF_ERR_VALUE,
                        "%s: %s, pixel (%zu,%zu): expected a finite value, found NaN or infinity", f->path,
                        where, rest / f->pixel_bytes % (size_t)f->info.n_theta, y);
    }
    p->checked = !*own;
    return ILF_OK;
}

/* Probe k from here on; under lock. */
static void publish(ilf *f, int64_t k, const unsigned char *pix, void *own)
{
    probe *p = &f->probes[k];

    if (!p->known) {
        row_mean(p->pole[0], f, pix);
        row_mean(p->pole[1], f, pix + (size_t)(f->info.n_phi - 1) * f->row_bytes);
        f->usage.probes++;
    }
    if (!p->known || own)
        *(own ? &f->usage.decoded_bytes : &f->usage.mapped_bytes) += (int64_t)f->probe_bytes;
    p->known = 1;
    p->decoded = own;
    if (own) ilf_memory_keep(f, k);
    atomic_store_explicit(&f->pix[k], pix, memory_order_release);
}

/* Read probe k, by this thread alone; under lock, which others may have meanwhile. */
static ilf_status bring_in(ilf *f, int64_t k, ilf_error *err)
{
    const unsigned char *pix;
    const int bounded = f->memory.most && !f->in_place;
    void *own = bounded ? ilf_memory_take(f) : NULL;

    f->probes[k].loading = 1;
    pthread_mutex_unlock(&f->lock);
    const ilf_status st = get_tile(f, k, &pix, &own, err);
    pthread_mutex_lock(&f->lock);
    f->probes[k].loading = 0;
    if (st == ILF_OK) publish(f, k, pix, own);
    else {
        free(own);
        if (bounded) ilf_memory_none(f);
    }
    pthread_cond_broadcast(&f->loaded);
    return st;
}

/* Probe k ready; under lock. */
static ilf_status need_locked(ilf *f, int64_t k, ilf_error *err)
{
    ilf_status st = ILF_OK;

    while (st == ILF_OK && !atomic_load_explicit(&f->pix[k], memory_order_relaxed)) {
        if (f->probes[k].loading) pthread_cond_wait(&f->loaded, &f->lock);
        else st = bring_in(f, k, err);
    }
    return st;
}

ilf_status ilf_load_probe(const ilf *field, int64_t k, ilf_error *err)
{
    /* the field's meaning does not change by being read, so lookups take it const */
    ilf *f = (ilf *)(uintptr_t)field;

    pthread_mutex_lock(&f->lock);
    const ilf_status st = need_locked(f, k, err);
    pthread_mutex_unlock(&f->lock);
    return st;
}

/* A copy of texels, which may be given back once the lock is; NULL without memory. */
static unsigned char *copied(const unsigned char *pix, const ilf *f)
{
    unsigned char *copy = malloc(TEXEL_HEAD + f->probe_bytes);

    if (copy) memcpy(copy, pix - TEXEL_HEAD, TEXEL_HEAD + f->probe_bytes);
    return copy;
}

ilf_status ilf_peek_probe(const ilf *field, int64_t k, const unsigned char **pix, void **own, ilf_error *err)
{
    ilf *f = (ilf *)(uintptr_t)field;
    const probe_memory *m = &f->memory;
    ilf_status st = ILF_OK;

    *own = NULL;
    pthread_mutex_lock(&f->lock);
    *pix = atomic_load_explicit(&f->pix[k], memory_order_relaxed);
    /* what is decoded once need not be twice, if there is room for it */
    const int stays = !f->in_place && (!m->most || m->n < m->most);
    if (!*pix && stays && (st = need_locked(f, k, err)) == ILF_OK)
        *pix = atomic_load_explicit(&f->pix[k], memory_order_relaxed);
    if (*pix && m->most && f->probes[k].decoded) {
        unsigned char *copy = copied(*pix, f);
        *own = copy;
        *pix = copy ? copy + TEXEL_HEAD : NULL;
    }
    pthread_mutex_unlock(&f->lock);
    if (st == ILF_OK && !*pix) {
        st = get_tile(f, k, pix, own, err);
        if (st != ILF_OK) free(*own);
    }
    return st;
}

void ilf_unpeek_probe(const ilf *f, const unsigned char *pix, void *own)
{
    free(own);
    /* decoded texels that a lookup keeps are memory that nothing else holds: to give them back would be to
     * lose them */
    if (own || !f->map || pix < f->map || pix >= f->map + f->info.file_bytes) return;
    /* a look through the whole file should not stay in memory: give back the pages that are the probe's alone
     */
    const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
    const uintptr_t from = ((uintptr_t)pix + page - 1) & ~(page - 1),
                    to = ((uintptr_t)pix + f->probe_bytes) & ~(page - 1);
    if (to > from) madvise((void *)from, to - from, MADV_DONTNEED);
}

/* Probe (i, j) ready, its number in *k, and the lock held; after a failure it is not. */
static ilf_status lock_probe(int64_t *k, ilf *f, int i, int j, ilf_error *err)
{
    if (!(i >= 0 && j >= 0 && i < f->info.n_u && j < f->info.n_v))
        return ilf_fail(err, ILF_ERR_ARG, "%s: probe (%d,%d): expected one of %dx%d", f->path, i, j,
                        f->info.n_u, f->info.n_v);
    *k = (int64_t)j * f->info.n_u + i;
    pthread_mutex_lock(&f->lock);
    const ilf_status st = need_locked(f, *k, err);
    if (st != ILF_OK) pthread_mutex_unlock(&f->lock);
    return st;
}

static void copy_out(float *rgb, const ilf *f, const unsigned char *pix)
{
    for (int y = 0; y < f->info.n_phi; y++)
        for (int x = 0; x < f->info.n_theta; x++)
            for (int c = 0; c < 3; c++)
                *rgb++ = ilf_texel(f, pix + (size_t)y * f->row_bytes + f->chan_offset[c] +
                                          (size_t)x * f->pixel_bytes);
}

ilf_status ilf_read_probe(float *rgb, const ilf *field, int i, int j, ilf_error *err)
{
    ilf *f = (ilf *)(uintptr_t)field;
    int64_t k;
    const ilf_status st = lock_probe(&k, f, i, j, err);

    if (st != ILF_OK) return st;
    const int bounded = f->memory.most != 0;
    const unsigned char *pix = atomic_load_explicit(&f->pix[k], memory_order_relaxed);
    if (bounded) copy_out(rgb, f, pix); /* while it can't be given back */
    pthread_mutex_unlock(&f->lock);
    if (!bounded) copy_out(rgb, f, pix);
    return ILF_OK;
}

ilf_status ilf_view_probe(ilf_view *view, const ilf *field, int i, int j, ilf_error *err)
{
    ilf *f = (ilf *)(uintptr_t)field;
    int64_t k;
    const ilf_status st = lock_probe(&k, f, i, j, err);

    if (st != ILF_OK) return st;
    f->probes[k].pinned = 1;
    const unsigned char *pix = atomic_load_explicit(&f->pix[k], memory_order_relaxed);
    const int in_file = !f->probes[k].decoded;
    pthread_mutex_unlock(&f->lock);
    /* in both orders the channels are evenly apart: B G R of a row, or R G B of a texel */
    *view = (ilf_view){.red = pix + f->chan_offset[0],
                       .type = f->is_half ? ILF_HALF : ILF_FLOAT,
                       .row = (ptrdiff_t)f->row_bytes,
                       .column = (ptrdiff_t)f->pixel_bytes,
                       .channel = (ptrdiff_t)f->chan_offset[1] - (ptrdiff_t)f->chan_offset[0],
                       .in_file = in_file};
    return ILF_OK;
}
