/*
 * image_jpeg.c - JPEG in, grey or colour, 8 bit, through libjpeg.  Rows stream; a progressive file
 * keeps its coefficients inside the library.  Orientation comes from the first EXIF block, and whether the
 * picture calls itself a panorama from its XMP (GPano).
 */
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jerror.h>
#include <jpeglib.h>

#include "image_internal.h"

enum { SCANS_MAX = 200 }; /* an honest progressive file has about ten */
static const long memory_max = 4L << 30;

typedef struct jpeg_state {
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr error;
    struct jpeg_progress_mgr progress;
    jmp_buf jump;
    char words[JMSG_LENGTH_MAX];
    unsigned char *line;
    int created, started;
} jpeg_state;

static void on_error(j_common_ptr c)
{
    jpeg_state *s = c->client_data;
    (*c->err->format_message)(c, s->words);
    longjmp(s->jump, 1);
}

/* The library patches broken data with grey and a warning.  We refuse it, but for remarks that
 * leave the pixels alone. */
static void on_message(j_common_ptr c, int level)
{
    int code = c->err->msg_code;
    if (level < 0 && code != JWRN_EXTRANEOUS_DATA && code != JWRN_ADOBE_XFORM && code != JWRN_JFIF_MAJOR)
        on_error(c);
}

static void on_progress(j_common_ptr c)
{
    jpeg_state *s = c->client_data;
    if (s->jpeg.input_scan_number > SCANS_MAX) {
        snprintf(s->words, sizeof s->words, "more than %d scans", SCANS_MAX);
        longjmp(s->jump, 1);
    }
}

static int jpeg_sniff(const unsigned char *head, size_t n)
{
    return n >= 3 && head[0] == 0xff && head[1] == 0xd8 && head[2] == 0xff;
}

static int jpeg_bad(const img_reader *r, errmsg *e)
{
    return img_bad(r, e, "broken or unknown JPEG file: %s", ((jpeg_state *)r->state)->words);
}

/* The blocks that are kept: EXIF's orientation counts where the first says one, XMP's projection anywhere. */
static void jpeg_facts(img_reader *r, const struct jpeg_decompress_struct *jpeg)
{
    int exif = 0;
    for (jpeg_saved_marker_ptr m = jpeg->marker_list; m; m = m->next) {
        if (m->marker != JPEG_APP0 + 1) continue;
        if (m->data_length > 6 && memcmp(m->data, "Exif\0", 6) == 0 && !exif++)
            r->info.orientation = img_exif_orientation(m->data, m->data_length);
        img_xmp_panorama(&r->info, m->data, m->data_length);
    }
}

static int jpeg_open(img_reader *r, errmsg *e)
{
    jpeg_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    s->jpeg.err = jpeg_std_error(&s->error);
    s->error.error_exit = on_error;
    s->error.emit_message = on_message;
    s->jpeg.client_data = s;
    if (setjmp(s->jump)) return jpeg_bad(r, e);
    jpeg_create_decompress(&s->jpeg);
    s->created = 1;
    s->jpeg.client_data = s;
    s->progress.progress_monitor = on_progress;
    s->jpeg.progress = &s->progress;
    s->jpeg.mem->max_memory_to_use = memory_max;
    jpeg_stdio_src(&s->jpeg, r->f);
    jpeg_save_markers(&s->jpeg, JPEG_APP0 + 1, 0xffff);
    jpeg_read_header(&s->jpeg, TRUE);
    jpeg_facts(r, &s->jpeg);
    if (s->jpeg.saw_JFIF_marker) img_density(r, s->jpeg.X_density, s->jpeg.Y_density);
    int grey = s->jpeg.jpeg_color_space == JCS_GRAYSCALE;
    if (!grey && s->jpeg.jpeg_color_space != JCS_YCbCr && s->jpeg.jpeg_color_space != JCS_RGB)
        return img_bad(r, e, "expected a grey or RGB JPEG, found %d colour components of another kind",
                       s->jpeg.num_components);
    s->jpeg.out_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
    return img_set_info(r, s->jpeg.image_width, s->jpeg.image_height, grey ? 1 : 3, 255, e);
}

static void jpeg_close(img_reader *r)
{
    jpeg_state *s = r->state;
    if (!s) return;
    if (s->created) jpeg_destroy_decompress(&s->jpeg);
    free(s->line);
    free(s);
}

static int jpeg_row(img_reader *r, float *row, errmsg *e)
{
    jpeg_state *s = r->state;
    size_t n = (size_t)r->info.width * (size_t)r->info.channels;
    if (!s->line) s->line = malloc(n);
    if (!s->line) return img_bad(r, e, "out of memory");
    if (setjmp(s->jump)) return jpeg_bad(r, e);
    if (!s->started) {
        jpeg_start_decompress(&s->jpeg);
        s->started = 1;
    }
    JSAMPROW lines[1] = {s->line};
    jpeg_read_scanlines(&s->jpeg, lines, 1);
    for (size_t i = 0; i < n; i++) row[i] = s->line[i];
    return 0;
}

const img_codec img_codec_jpeg = {"jpeg", jpeg_sniff, jpeg_open, jpeg_row, jpeg_close, NULL};
