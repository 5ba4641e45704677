/*
 * ilf_layout.c - in which order texels lie in memory, and the part of a file that holds them interleaved.
 *
 * The first part of a file is what OpenEXR makes of it: for each row of a tile all B, then all G, then all R.
 * Used in place, a lookup then needs 24 short stretches of it, each from another cache line.  A second part
 * may hold the same numbers once more for use in place, a texel's R G B side by side (docs/FORMAT.md, section
 * 1.5, says how).
 *
 * It is derived data: a reader may ignore it, and the first part counts.  So a part that looks otherwise is
 * not used, and each of its tiles is compared with the first part's when it is first needed.  (A digest in
 * the header would not do: to tell that the first part was edited, the first part must be read.)
 */
#include <stdlib.h>
#include <unistd.h>

#include "exr/exr_bytes.h"
#include "ilf_internal.h"

static int is_interleaved(const ilf *f, int part)
{
    const exr_attribute_t *a = NULL;
    const exr_attr_chlist_t *list;
    const int64_t w = 3 * (int64_t)f->info.n_theta * f->info.n_u, h = (int64_t)f->info.n_phi * f->info.n_v;
    exr_storage_t storage;
    exr_attr_box2i_t dw;
    uint32_t tw, th;
    exr_tile_level_mode_t level;
    exr_tile_round_mode_t round;
    exr_compression_t compression;

    return exr_get_attribute_by_name(f->exr, part, ILF_INTERLEAVED_ATTRIBUTE, &a) == EXR_ERR_SUCCESS && a &&
           a->type == EXR_ATTR_INT && a->i == 1 &&
           exr_get_storage(f->exr, part, &storage) == EXR_ERR_SUCCESS && storage == EXR_STORAGE_TILED &&
           exr_get_compression(f->exr, part, &compression) == EXR_ERR_SUCCESS &&
           compression == EXR_COMPRESSION_NONE &&
           exr_get_tile_descriptor(f->exr, part, &tw, &th, &level, &round) == EXR_ERR_SUCCESS &&
           level == EXR_TILE_ONE_LEVEL && tw == 3 * (uint32_t)f->info.n_theta &&
           th == (uint32_t)f->info.n_phi && exr_get_data_window(f->exr, part, &dw) == EXR_ERR_SUCCESS &&
           dw.min.x == 0 && dw.min.y == 0 && dw.max.x == w - 1 && dw.max.y == h - 1 &&
           exr_get_channels(f->exr, part, &list) == EXR_ERR_SUCCESS && list->num_channels == 1 &&
           !strcmp(list->entries[0].name.str, ILF_INTERLEAVED_CHANNEL) &&
           list->entries[0].pixel_type == (f->is_half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT) &&
           list->entries[0].x_sampling == 1 && list->entries[0].y_sampling == 1;
}

static int find_interleaved(const ilf *f)
{
    int parts = 1;

    if (exr_get_count(f->exr, &parts) != EXR_ERR_SUCCESS) return 0;
    for (int part = 1; part < parts; part++)
        if (is_interleaved(f, part)) return part;
    return 0;
}

void ilf_choose_layout(ilf *f)
{
    const int compressed = strcmp(f->info.compression, "none") != 0;

    f->in_place = f->map && f->uniform && !compressed;
    f->second_part = f->in_place ? find_interleaved(f) : 0;
    f->info.interleaved = f->second_part > 0;
    const int planar = f->in_place && !f->second_part;
    f->pixel_bytes = planar ? f->texel_bytes : 3 * f->texel_bytes;
    for (int c = 0; c < 3; c++) f->chan_offset[c] = planar ? f->raw.start[c] : (size_t)c * f->texel_bytes;

    f->columns_per_radian = f->info.n_theta / (2 * ILF_PI);
    f->rows_per_radian = f->info.n_phi / f->info.polar_max;
    f->column_ahead = 0.5 * f->info.n_theta - 0.5;
    f->last_row = f->info.n_phi - 1;
    f->span_u = f->info.n_u > 1 ? f->info.n_u - 1 : 2;
    f->span_v = f->info.n_v > 1 ? f->info.n_v - 1 : 2;
    f->fast[0] = ilf_eval_avx2(f, 0);
    f->fast[1] = ilf_eval_avx2(f, 1);
}

/* ---- from one order to the other ------------------------------------------------------------ */

/* Does a row of texels together hold what a planar one does? */
static int same_row(unsigned char *row, const unsigned char *planar, const ilf *f)
{
    const size_t n = (size_t)f->info.n_theta, size = f->texel_bytes;
    unsigned differ = 0;

    for (int c = 0; c < 3; c++) {
        const unsigned char *p = planar + f->raw.start[c], *q = row + (size_t)c * size;
        if (size == 2)
            for (size_t x = 0; x < n; x++) {
                uint16_t a, b;
                memcpy(&a, p + 2 * x, 2);
                memcpy(&b, q + 6 * x, 2);
                differ |= (unsigned)(a ^ b);
            }
        else
            for (size_t x = 0; x < n; x++) {
                uint32_t a, b;
                memcpy(&a, p + 4 * x, 4);
                memcpy(&b, q + 12 * x, 4);
                differ |= a ^ b;
            }
    }
    return differ == 0;
}

static int copy_row(unsigned char *row, const unsigned char *planar, const ilf *f)
{
    const size_t n = (size_t)f->info.n_theta, size = f->texel_bytes;

    for (int c = 0; c < 3; c++) {
        const unsigned char *p = planar + f->raw.start[c];
        unsigned char *q = row + (size_t)c * size;
        if (f->raw.is_half[c] == f->is_half)
            for (size_t x = 0; x < n; x++) memcpy(q + 3 * x * size, p + x * size, size);
        else /* a half among floats */
            for (size_t x = 0; x < n; x++) {
                uint16_t h;
                memcpy(&h, p + 2 * x, 2);
                const float v = half_to_float_any(h);
                memcpy(q + 3 * x * size, &v, size);
            }
    }
    return 1;
}

/* Each row of a raw tile at `planar` with the probe's at pix; 0 at the first that fails. */
static int each_row(const ilf *f, unsigned char *pix, uint64_t planar,
                    int (*row)(unsigned char *, const unsigned char *, const ilf *))
{
    /* read, not mapped: the first part's pages are not to count as this process's memory */
    const size_t bytes = f->raw.bytes, rows = bytes < 1 << 16 ? (1 << 16) / bytes : 1,
                 n_phi = (size_t)f->info.n_phi;
    unsigned char *some = malloc(rows * bytes);
    int good = some != NULL;

    for (size_t y = 0; y < n_phi && good; y += rows) {
        const size_t n = n_phi - y < rows ? n_phi - y : rows;
        good = exr_bytes_at(f->fd, some, n * bytes, planar + y * bytes) == 0;
        for (size_t k = 0; k < n && good; k++) good = row(pix + (y + k) * f->row_bytes, some + k * bytes, f);
    }
    free(some);
    return good;
}

int ilf_same_texels(const ilf *f, const unsigned char *pix, uint64_t planar)
{
    return each_row(f, (unsigned char *)(uintptr_t)pix, planar, same_row); /* which writes nothing */
}

int ilf_copy_texels(const ilf *f, unsigned char *pix, uint64_t planar)
{
    return each_row(f, pix, planar, copy_row);
}
