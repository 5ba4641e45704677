/*
 * ilf_lampwrite.c - write the lamps of a file of version 2.
 */
#include <stdio.h>
#include <stdlib.h>

#include "exr/exr_whole.h"
#include "ilf_lampfile.h"

#define TRY(call)                                                                                            \
    if ((r = (call)) != EXR_ERR_SUCCESS) return r

/* Do a picture's samples fit into halves, if the file is to hold halves? */
static exr_pixel_type_t type_of(const ilf_spec *s, const ilf_mask *m)
{
    const int64_t n = ilf_mask_samples(m);

    if (s->type != ILF_HALF) return EXR_PIXEL_FLOAT;
    for (int64_t k = 0; k < n; k++)
        if (fabsf(m->grid[k]) > 65504.f) return EXR_PIXEL_FLOAT;
    return EXR_PIXEL_HALF;
}

/* ---- header ------------------------------------------------------------------------------------- */

static exr_result_t add_lines(exr_context_t x, const char *name, int w, int h,
                              const exr_attr_box2i_t *display, int *part)
{
    const exr_attr_box2i_t window = {{{{0, 0}}}, {{{w - 1, h - 1}}}};
    const exr_attr_v2f_t centre = {{{0, 0}}};
    exr_result_t r;

    TRY(exr_add_part(x, name, EXR_STORAGE_SCANLINE, part));
    return exr_initialize_required_attr(x, *part, display, &window, 1.f, &centre, 1.f,
                                        EXR_LINEORDER_INCREASING_Y, EXR_COMPRESSION_ZIP);
}

static exr_result_t add_rows(exr_context_t x, const ilf_spec *s, float *row, int masks)
{
    float *at = row;
    exr_result_t r;

    for (int i = 0; i < s->n_lamps; i++, at += ROW_NUMBERS) ilf_lamp_to_row(at, &s->lamps[i]);
    TRY(exr_attr_set_float_vector(x, 0, LAMPS_ATTRIBUTE, s->n_lamps * ROW_NUMBERS, row));
    at = row;
    for (int i = 0; i < s->n_lamps; i++)
        for (int k = 0; k < s->lamps[i].nmasks; k++, at += ROW_NUMBERS)
            ilf_mask_to_row(at, &s->lamps[i].masks[k]);
    return masks ? exr_attr_set_float_vector(x, 0, MASKS_ATTRIBUTE, masks * ROW_NUMBERS, row)
                 : EXR_ERR_SUCCESS;
}

static exr_result_t add_pictures(exr_context_t x, const ilf_spec *s, const exr_attr_box2i_t *display)
{
    int number = 0, part;
    char name[32];
    exr_result_t r;

    for (int i = 0; i < s->n_lamps; i++)
        for (int k = 0; k < s->lamps[i].nmasks; k++) {
            const ilf_mask *m = &s->lamps[i].masks[k];
            (void)!snprintf(name, sizeof name, MASK_PART, ++number);
            if (ilf_mask_samples(m) == 0) continue;
            TRY(add_lines(x, name, m->nx, m->ny * (m->kind == ILF_MASK_STACK ? m->nz : 1), display, &part));
            TRY(exr_add_channel(x, part, MASK_CHANNEL, type_of(s, m), EXR_PERCEPTUALLY_LINEAR, 1, 1));
        }
    return EXR_ERR_SUCCESS;
}

static exr_result_t add_measured(exr_context_t x, const ilf_spec *s, const exr_attr_box2i_t *display)
{
    int part = 0;
    char name[32];
    exr_result_t r;

    for (int i = 0; i < s->n_lamps; i++) {
        if (!s->lamps[i].seen) continue;
        if (!part) TRY(add_lines(x, MEASURED_PART, s->n_u, s->n_v, display, &part));
        (void)!snprintf(name, sizeof name, LAMP_CHANNEL, i + 1);
        TRY(exr_add_channel(x, part, name, EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LINEAR, 1, 1));
    }
    return EXR_ERR_SUCCESS;
}

exr_result_t ilf_declare_lamps(exr_context_t x, const ilf_spec *s, const exr_attr_box2i_t *display)
{
    int masks = 0;
    exr_result_t r;

    for (int i = 0; i < s->n_lamps; i++) masks += s->lamps[i].nmasks;
    const int most = masks > s->n_lamps ? masks : s->n_lamps;
    float *row = malloc((size_t)most * ROW_NUMBERS * sizeof *row);
    r = row ? add_rows(x, s, row, masks) : EXR_ERR_OUT_OF_MEMORY;
    free(row);
    if (r == EXR_ERR_SUCCESS) r = add_pictures(x, s, display);
    return r == EXR_ERR_SUCCESS ? add_measured(x, s, display) : r;
}

/* ---- parts -------------------------------------------------------------------------------------- */

/* Samples of some lines as the file holds them: one picture a channel in `from`. */
static void set_channels(exr_encode_pipeline_t *e, const float *const *from, uint16_t *half, int w, int y)
{
    for (int c = 0; c < e->channel_count; c++) {
        exr_coding_channel_info_t *ch = &e->channels[c];
        const size_t n = (size_t)w * (size_t)ch->height;
        const float *start = from[c] + (size_t)w * (size_t)y;
        const int bytes = ch->data_type == EXR_PIXEL_HALF ? 2 : 4;

        for (size_t k = 0; bytes == 2 && k < n; k++) half[k] = half_from_float(start[k]);
        ch->encode_from_ptr = bytes == 2 ? (const uint8_t *)half : (const uint8_t *)start;
        ch->user_bytes_per_element = (int16_t)bytes;
        ch->user_data_type = (uint16_t)ch->data_type;
        ch->user_pixel_stride = bytes;
        ch->user_line_stride = bytes * w;
    }
}

static exr_result_t write_some(exr_context_t x, int part, const float *const *from, uint16_t *half, int w,
                               int y)
{
    exr_encode_pipeline_t e = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_compress_fn *kept = NULL;
    exr_chunk_info_t chunk;
    exr_result_t r;

    TRY(exr_write_scanline_chunk_info(x, part, y, &chunk));
    r = exr_encoding_initialize(x, part, &chunk, &e);
    if (r != EXR_ERR_SUCCESS) return r;
    set_channels(&e, from, half, w, y);
    r = exr_encoding_choose_default_routines(x, part, &e);
    exr_keep_incompressible(&e, &kept);
    if (r == EXR_ERR_SUCCESS) r = exr_encoding_run(x, part, &e);
    exr_encoding_destroy(x, &e);
    return r;
}

/* A part of w x h samples; one picture a channel. */
static exr_result_t write_lines(exr_context_t x, int part, const float *const *from, int w, int h)
{
    int32_t lines = 0;
    exr_result_t r;

    TRY(exr_get_scanlines_per_chunk(x, part, &lines));
    uint16_t *half = malloc((size_t)lines * (size_t)w * sizeof *half);
    if (!half) return EXR_ERR_OUT_OF_MEMORY;
    for (int y = 0; y < h && r == EXR_ERR_SUCCESS; y += lines) r = write_some(x, part, from, half, w, y);
    free(half);
    return r;
}

/* OpenEXR has a part's channels in alphabetical order: lamp.1, lamp.10, lamp.2. */
static int by_channel(const void *a, const void *b)
{
    char p[32], q[32];

    (void)!snprintf(p, sizeof p, LAMP_CHANNEL, *(const int *)a + 1);
    (void)!snprintf(q, sizeof q, LAMP_CHANNEL, *(const int *)b + 1);
    return strcmp(p, q);
}

static exr_result_t write_measured(exr_context_t x, const ilf_spec *s, int part)
{
    int lamp[MOST_LAMPS], n = 0;
    const float *from[MOST_LAMPS];

    for (int i = 0; i < s->n_lamps; i++)
        if (s->lamps[i].seen) lamp[n++] = i;
    qsort(lamp, (size_t)n, sizeof *lamp, by_channel);
    for (int c = 0; c < n; c++) from[c] = s->lamps[lamp[c]].seen;
    return n ? write_lines(x, part, from, s->n_u, s->n_v) : EXR_ERR_SUCCESS;
}

exr_result_t ilf_write_lamps(exr_context_t x, const ilf_spec *s, int part)
{
    exr_result_t r;

    for (int i = 0; i < s->n_lamps; i++)
        for (int k = 0; k < s->lamps[i].nmasks; k++) {
            const ilf_mask *m = &s->lamps[i].masks[k];
            const float *from = m->grid;
            if (ilf_mask_samples(m) == 0) continue;
            TRY(write_lines(x, part++, &from, m->nx, m->ny * (m->kind == ILF_MASK_STACK ? m->nz : 1)));
        }
    return write_measured(x, s, part);
}
