/*
 * halfraw.c - see halfraw.h.  Nothing that LibRaw adapts to the picture's content is on, so that exposures
 * stay proportional.
 */
#include "halfraw.h"

#include <stdlib.h>
#include <string.h>

#include <libraw/libraw.h>

/* LibRaw goes on past damage; a picture with holes is worse than none.  The offset's type differs
 * between its versions. */
static void damaged(void *data, const char *file, const int offset)
{
    (void)file;
    (void)offset;
    *(int *)data = 1;
}

static void damaged_64(void *data, const char *file, const INT64 offset)
{
    (void)file;
    (void)offset;
    *(int *)data = 1;
}

static libraw_data_t *begin(const char *path, int *broken, errmsg *e)
{
    libraw_data_t *raw = libraw_init(0);
    if (!raw) {
        err_set(e, "%s: out of memory", path);
        return NULL;
    }
    *broken = 0;
    libraw_set_dataerror_handler(raw, _Generic((data_callback)0, void (*)(void *, const char *, const int): damaged,
                                               default: damaged_64), broken);
    libraw_output_params_t *p = &raw->params;
    p->half_size = 1;
    p->use_camera_wb = 1;
    p->use_auto_wb = 0;
    p->output_color = 1; /* sRGB primaries */
    p->gamm[0] = p->gamm[1] = 1;
    p->output_bps = 16;
    p->no_auto_bright = 1;
    p->adjust_maximum_thr = 0;
    p->highlight = 0;
    int rc = libraw_open_file(raw, path);
    if (rc != LIBRAW_SUCCESS) {
        err_set(e, "%s: broken or unknown camera raw file: %s", path, libraw_strerror(rc));
        libraw_close(raw);
        return NULL;
    }
    return raw;
}

int halfraw_size(int *width, int *height, const char *path, errmsg *e)
{
    int broken;
    libraw_data_t *raw = begin(path, &broken, e);
    if (!raw)
        return -1;
    int rc = libraw_adjust_sizes_info_only(raw); /* halves them, and turns them as the camera was */
    *width = raw->sizes.iwidth;
    *height = raw->sizes.iheight;
    libraw_close(raw);
    return rc == LIBRAW_SUCCESS ? 0 : err_set(e, "%s: broken camera raw file: %s", path, libraw_strerror(rc));
}

int halfraw_read(uint16_t **rgb, int width, int height, const char *path, errmsg *e)
{
    int code = -1, broken;
    libraw_processed_image_t *im = NULL;
    libraw_data_t *raw = begin(path, &broken, e);
    if (!raw)
        return -1;
    int rc = libraw_unpack(raw);
    if (rc == LIBRAW_SUCCESS)
        rc = libraw_dcraw_process(raw);
    if (rc == LIBRAW_SUCCESS)
        im = libraw_dcraw_make_mem_image(raw, &rc);
    size_t n = (size_t)width * (size_t)height * 3;
    if (!im || broken)
        err_set(e, "%s: broken camera raw file: %s", path, libraw_strerror(broken ? LIBRAW_DATA_ERROR : rc));
    else if (im->bits != 16 || im->colors != 3 || im->width != width || im->height != height)
        err_set(e, "%s: expected a raw picture of %dx%d pixels at half size, found %dx%d with %d channels", path, width,
                height, im->width, im->height, im->colors);
    else if (!(*rgb = malloc(n * sizeof **rgb)))
        err_set(e, "%s: out of memory", path);
    else {
        memcpy(*rgb, im->data, n * sizeof **rgb);
        code = 0;
    }
    if (im)
        libraw_dcraw_clear_mem(im);
    libraw_close(raw);
    return code;
}
