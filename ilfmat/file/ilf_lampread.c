/*
 * ilf_lampread.c - read the lamps of a file of version 2.
 *
 * All of it is read when the file is opened: the numbers first, which say how large the pictures are, so that
 * nothing is taken from memory before its size is known to be sane.
 */
#include <stdio.h>
#include <stdlib.h>

#include "exr/exr_compression.h"
#include "ilf_lampfile.h"

void ilf_free_lamps(ilf_luminaire *lamps, int n)
{
    for (int i = 0; lamps && i < n; i++) {
        for (int k = 0; lamps[i].masks && k < lamps[i].nmasks; k++) free(lamps[i].masks[k].grid);
        free(lamps[i].masks);
        free(lamps[i].seen);
    }
    free(lamps);
}

/* ---- numbers ------------------------------------------------------------------------------------ */

/* An attribute's rows; *n of them; *row is NULL where there is none. */
static ilf_status rows(const float **row, int *n, const ilf *f, const char *name, int least, int most,
                       ilf_error *err)
{
    const exr_attribute_t *a;
    const ilf_status st = ilf_attribute(f, name, EXR_ATTR_FLOAT_VECTOR, "floatvector", least == 0, &a, err);

    *row = NULL;
    *n = 0;
    if (st != ILF_OK) return st;
    const int length = a ? a->floatvector->length : 0;
    if (length % ROW_NUMBERS || length / ROW_NUMBERS < least || length / ROW_NUMBERS > most)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected %d to %d rows of %d numbers, found %d numbers",
                        f->path, name, least, most, ROW_NUMBERS, length);
    if (a) *row = a->floatvector->arr;
    *n = length / ROW_NUMBERS;
    return ILF_OK;
}

/* The lamps of the file, without masks. */
static ilf_status read_lamp_rows(ilf *f, int *masks, ilf_error *err)
{
    const float *row;
    int n;
    ilf_status st = rows(&row, &n, f, LAMPS_ATTRIBUTE, 1, MOST_LAMPS, err);

    *masks = 0;
    for (int i = 0; i < n && st == ILF_OK; i++) {
        st = ilf_check_lamp_row(row + i * ROW_NUMBERS, i + 1, f->path, ILF_ERR_FORMAT, err);
        if (st == ILF_OK) *masks += (int)row[i * ROW_NUMBERS + 15];
    }
    if (st != ILF_OK) return st;
    if (!(f->lamps = calloc((size_t)n, sizeof *f->lamps)))
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for %d lamps", f->path, n);
    f->n_lamps = n;
    for (int i = 0; i < n; i++) ilf_lamp_from_row(&f->lamps[i], row + i * ROW_NUMBERS);
    return ILF_OK;
}

/* Their masks, without pictures; *samples: of all pictures. */
static ilf_status read_mask_rows(ilf *f, int masks, int64_t *samples, ilf_error *err)
{
    const float *row;
    int n;
    ilf_status st = rows(&row, &n, f, MASKS_ATTRIBUTE, masks, masks, err);

    *samples = 0;
    for (int i = 0; i < n && st == ILF_OK; i++) {
        ilf_mask m;
        st = ilf_check_mask_row(row + i * ROW_NUMBERS, i + 1, f->path, ILF_ERR_FORMAT, err);
        if (st == ILF_OK) ilf_mask_from_row(&m, row + i * ROW_NUMBERS), *samples += ilf_mask_samples(&m);
    }
    if (st == ILF_OK && *samples > MOST_SAMPLES)
        st = ilf_fail(err, ILF_ERR_FORMAT,
                      "%s: %s: expected pictures of at most %d samples in all, found %lld", f->path,
                      MASKS_ATTRIBUTE, MOST_SAMPLES, (long long)*samples);
    for (int i = 0; i < f->n_lamps && st == ILF_OK; i++) {
        ilf_luminaire *l = &f->lamps[i];
        if (l->nmasks && !(l->masks = calloc((size_t)l->nmasks, sizeof *l->masks)))
            st = ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for %d masks", f->path, masks);
        for (int k = 0; k < l->nmasks && st == ILF_OK; k++, row += ROW_NUMBERS)
            ilf_mask_from_row(&l->masks[k], row);
    }
    return st;
}

/* ---- parts --------------------------------------------------------------------------------------- */

/* A part of scan lines, one float a sample in memory. */
typedef struct part {
    const char *name;
    int number, w, h;
    const exr_attr_chlist_t *channels;
} part;

/* The number of the part of this name, or 0. */
static int find_part(const ilf *f, const char *name)
{
    const char *found;
    int parts = 1;

    if (exr_get_count(f->exr, &parts) != EXR_ERR_SUCCESS) return 0;
    for (int k = 1; k < parts; k++)
        if (exr_get_name(f->exr, k, &found) == EXR_ERR_SUCCESS && found && !strcmp(found, name)) return k;
    return 0;
}

/* Fill p->channels of a part that looks as it should. */
static ilf_status check_part(part *p, const ilf *f, ilf_error *err)
{
    exr_storage_t storage;
    exr_attr_box2i_t dw;
    exr_compression_t c;

    if (exr_get_storage(f->exr, p->number, &storage) != EXR_ERR_SUCCESS || storage != EXR_STORAGE_SCANLINE)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected scan lines, found tiles or deep data", f->path,
                        p->name);
    if (exr_get_data_window(f->exr, p->number, &dw) != EXR_ERR_SUCCESS || dw.min.x != 0 || dw.min.y != 0 ||
        dw.max.x != p->w - 1 || dw.max.y != p->h - 1)
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: %s: dataWindow: expected (0,0) to (%d,%d), found (%d,%d) to (%d,%d)", f->path,
                        p->name, p->w - 1, p->h - 1, dw.min.x, dw.min.y, dw.max.x, dw.max.y);
    if (exr_get_compression(f->exr, p->number, &c) != EXR_ERR_SUCCESS || c > EXR_COMPRESSION_PIZ)
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: %s: compression: expected none, rle, zips, zip or piz, found %s", f->path,
                        p->name, exr_compression_name((int)c) ? exr_compression_name((int)c) : "another");
    if (exr_get_channels(f->exr, p->number, &p->channels) != EXR_ERR_SUCCESS || p->channels->num_channels < 1)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: channels: expected some, found none", f->path, p->name);
    for (int k = 0; k < p->channels->num_channels; k++) {
        const exr_attr_chlist_entry_t *e = &p->channels->entries[k];
        if (e->pixel_type == EXR_PIXEL_UINT || e->x_sampling != 1 || e->y_sampling != 1)
            return ilf_fail(
                err, ILF_ERR_FORMAT,
                "%s: %s: channels: expected HALF or FLOAT without subsampling, found another in %s", f->path,
                p->name, e->name.str);
    }
    return ILF_OK;
}

static exr_result_t decode(exr_context_t exr, const part *p, const exr_chunk_info_t *chunk,
                           float *const *channel, int y)
{
    exr_decode_pipeline_t d = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t r = exr_decoding_initialize(exr, p->number, chunk, &d);

    if (r == EXR_ERR_SUCCESS) {
        for (int c = 0; c < d.channel_count; c++) {
            d.channels[c].decode_to_ptr = (unsigned char *)(channel[c] + (size_t)y * (size_t)p->w);
            d.channels[c].user_bytes_per_element = 4;
            d.channels[c].user_data_type = EXR_PIXEL_FLOAT;
            d.channels[c].user_pixel_stride = 4;
            d.channels[c].user_line_stride = 4 * p->w;
        }
        r = exr_decoding_choose_default_routines(exr, p->number, &d);
        if (r == EXR_ERR_SUCCESS) r = exr_decoding_run(exr, p->number, &d);
    }
    exr_decoding_destroy(exr, &d);
    return r;
}

/* All lines, to one picture a channel, in the channels' order. */
static ilf_status read_lines(ilf *f, const part *p, float *const *channel, ilf_error *err)
{
    const uint64_t bytes = (uint64_t)f->info.file_bytes;
    exr_chunk_info_t chunk;
    int32_t lines = 1;

    ilf_exr_words()->text[0] = 0;
    exr_result_t r = exr_get_scanlines_per_chunk(f->exr, p->number, &lines);
    for (int y = 0; y < p->h && r == EXR_ERR_SUCCESS && lines > 0; y += lines) {
        r = exr_read_scanline_chunk_info(f->exr, p->number, y, &chunk);
        if (r == EXR_ERR_SUCCESS && (chunk.start_y != y || chunk.data_offset > bytes ||
                                     chunk.packed_size > bytes - chunk.data_offset))
            return ilf_fail(err, ILF_ERR_FORMAT,
                            "%s: %s: line %d: expected it inside the file, found it cut off", f->path,
                            p->name, y);
        if (r == EXR_ERR_SUCCESS) r = decode(f->exr, p, &chunk, channel, y);
    }
    if (r == EXR_ERR_SUCCESS) return ILF_OK;
    return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected %d whole lines, found: %s", f->path, p->name, p->h,
                    ilf_exr_words()->text[0] ? ilf_exr_words()->text : exr_get_default_error_message(r));
}

static ilf_status read_picture(ilf *f, ilf_mask *m, int number, ilf_error *err)
{
    char name[32];
    part p = {.name = name, .w = m->nx, .h = m->ny * (m->kind == ILF_MASK_STACK ? m->nz : 1)};

    (void)!snprintf(name, sizeof name, MASK_PART, number);
    p.number = find_part(f, name);
    if (!p.number)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: expected a part of this name, found none", f->path,
                        name);
    const ilf_status st = check_part(&p, f, err);
    if (st != ILF_OK) return st;
    if (p.channels->num_channels != 1 || strcmp(p.channels->entries[0].name.str, MASK_CHANNEL) != 0)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: channels: expected " MASK_CHANNEL " alone, found %s%s",
                        f->path, name, p.channels->entries[0].name.str,
                        p.channels->num_channels > 1 ? " and others" : "");
    m->grid = calloc((size_t)p.w * (size_t)p.h, sizeof *m->grid);
    if (!m->grid) return ilf_fail(err, ILF_ERR_MEMORY, "%s: %s: no memory for it", f->path, name);
    return read_lines(f, &p, &m->grid, err);
}

/* The lamp that a channel of the measured part belongs to, or -1. */
static int lamp_of(const char *channel, int n)
{
    char name[32];

    for (int i = 0; i < n; i++) {
        (void)!snprintf(name, sizeof name, LAMP_CHANNEL, i + 1);
        if (!strcmp(channel, name)) return i;
    }
    return -1;
}

static ilf_status read_measured(ilf *f, int64_t samples, ilf_error *err)
{
    const int64_t probes = (int64_t)f->info.n_u * f->info.n_v;
    part p = {
        .name = MEASURED_PART, .number = find_part(f, MEASURED_PART), .w = f->info.n_u, .h = f->info.n_v};
    float *channel[MOST_LAMPS];

    if (!p.number) return ILF_OK;
    const ilf_status st = check_part(&p, f, err);
    if (st != ILF_OK) return st;
    const int n = p.channels->num_channels;
    if (n > f->n_lamps || n * probes > MOST_SAMPLES - samples)
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: %s: expected channels of at most %d lamps and %lld samples, found %d of %lld",
                        f->path, p.name, f->n_lamps, (long long)(MOST_SAMPLES - samples), n,
                        (long long)(n * probes));
    for (int c = 0; c < n; c++) {
        const int i = lamp_of(p.channels->entries[c].name.str, f->n_lamps);
        if (i < 0)
            return ilf_fail(err, ILF_ERR_FORMAT, "%s: %s: channels: expected lamp.1 to lamp.%d, found %s",
                            f->path, p.name, f->n_lamps, p.channels->entries[c].name.str);
        if (!f->lamps[i].seen) f->lamps[i].seen = calloc((size_t)probes, sizeof **channel);
        if (!(channel[c] = f->lamps[i].seen))
            return ilf_fail(err, ILF_ERR_MEMORY, "%s: %s: no memory for it", f->path, p.name);
    }
    return read_lines(f, &p, channel, err);
}

ilf_status ilf_read_lamps(ilf *f, ilf_error *err)
{
    int masks, number = 0;
    int64_t samples;
    ilf_status st = read_lamp_rows(f, &masks, err);

    if (st == ILF_OK) st = read_mask_rows(f, masks, &samples, err);
    for (int i = 0; i < f->n_lamps && st == ILF_OK; i++)
        for (int k = 0; k < f->lamps[i].nmasks && st == ILF_OK; k++) {
            number++;
            if (ilf_mask_samples(&f->lamps[i].masks[k]) > 0)
                st = read_picture(f, &f->lamps[i].masks[k], number, err);
        }
    if (st == ILF_OK) st = read_measured(f, samples, err);
    if (st != ILF_OK) return st;
    return ilf_check_lamp_values(f->lamps, f->n_lamps, (int64_t)f->info.n_u * f->info.n_v, f->path,
                                 ILF_ERR_FORMAT, err);
}
