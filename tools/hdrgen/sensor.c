/*
 * sensor.c - see sensor.h.  LibRaw unpacks; its black level of photosite (x, y) of colour c is
 * black + cblack[c] + cblack[6 + (y % rows) * columns + x % columns] with rows, columns = cblack[4],
 * cblack[5] (LibRaw's documentation of libraw_colordata_t).
 */
#include "sensor.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "image/rawfile.h"

enum { XTRANS = 9, FIRST_PATTERN = 1000, PATTERN_AT = 6, GREY = 6 };
static const double square = 0.005; /* pixels are square up to this */

static libraw_data_t *begin(const char *path, int *broken, errmsg *e)
{
    libraw_data_t *raw = rawfile_new(broken);
    if (!raw) {
        err_set(e, "%s: out of memory", path);
        return NULL;
    }
    int rc = libraw_open_file(raw, path);
    if (rc != LIBRAW_SUCCESS) {
        err_set(e, "%s: broken or unknown camera raw file: %s", path, libraw_strerror(rc));
        libraw_close(raw);
        return NULL;
    }
    return raw;
}

/* Three multipliers, least 1; zeros if they make no sense. */
static void multipliers(double to[3], const float from[4])
{
    double least = INFINITY;
    for (int c = 0; c < 3; c++) least = fmin(least, rawfile_stated(from[c]));
    for (int c = 0; c < 3; c++) to[c] = least > 1e-5 ? (double)from[c] / least : 0;
}

/* Size of the repeating pattern, and its colours; the second green is green. */
static int take_mosaic(sensor_facts *f, libraw_data_t *raw, const char *path, errmsg *e)
{
    unsigned filters = raw->idata.filters;
    cfa *m = &f->mosaic;
    m->columns = filters == XTRANS ? 6 : filters == 1 ? 16 : 2;
    m->rows = filters == XTRANS ? 6 : filters == 1 ? 16 : 8;
    for (int y = 0; y < m->rows; y++)
        for (int x = 0; x < m->columns; x++) {
            int c = libraw_COLOR(raw, y, x);
            if (c == 3 && raw->idata.cdesc[3] == 'G') c = 1;
            if (c < 0 || c > 2)
                return err_set(e, "%s: expected a sensor of red, green and blue, found colours %.4s", path,
                               raw->idata.cdesc);
            m->colour[y * m->columns + x] = (uint8_t)c;
        }
    if (filters > FIRST_PATTERN) { /* eight rows are stored, few sensors use more than two */
        int same = 1;
        for (int i = 4; i < 16; i++) same &= m->colour[i] == m->colour[i - 4];
        if (same) m->rows = 2;
    }
    return 0;
}

static int take_facts(sensor_facts *f, libraw_data_t *raw, const char *path, errmsg *e)
{
    memset(f, 0, sizeof *f);
    snprintf(f->camera, sizeof f->camera, "%s %s", raw->idata.make, raw->idata.model);
    f->width = raw->sizes.width;
    f->height = raw->sizes.height;
    f->aspect = raw->sizes.pixel_aspect > 0 ? raw->sizes.pixel_aspect : 1;
    f->orientation = rawfile_orientation(raw);
    f->exposure_s = rawfile_stated(raw->other.shutter);
    f->f_number = rawfile_stated(raw->other.aperture);
    f->iso = rawfile_stated(raw->other.iso_speed);
    if (f->width < 2 || f->height < 2)
        return err_set(e, "%s: expected a raw picture of 2x2 pixels or more, found %dx%d", path, f->width,
                       f->height);
    if (raw->rawdata.ioparams.fuji_width || strstr(raw->idata.model, "SuperCCD"))
        return err_set(e,
                       "%s: expected a sensor with upright rows, found one set at 45 degrees (%s): develop "
                       "the series as "
                       "16 bit linear TIFF first",
                       path, f->camera);
    if (fabs(f->aspect - 1) > square)
        return err_set(
            e, "%s: expected square pixels, found %g:1 (%s): develop the series as 16 bit linear TIFF first",
            path, f->aspect, f->camera);
    if (raw->idata.colors != 1 && raw->idata.colors != 3)
        return err_set(e, "%s: expected a sensor of red, green and blue, found %d colours (%.4s, %s)", path,
                       raw->idata.colors, raw->idata.cdesc, f->camera);
    if (raw->idata.colors == 3 && (raw->idata.filters == 0 || raw->idata.is_foveon)) f->channels = 3;
    else f->channels = 1;
    if (f->channels == 1 && raw->idata.colors == 3 && take_mosaic(f, raw, path, e)) return -1;
    multipliers(f->balance, raw->color.cam_mul);
    multipliers(f->daylight, raw->color.pre_mul);
    f->has_matrix = rawfile_matrix(f->matrix, raw, f->channels == 3 || f->mosaic.columns);
    return 0;
}

int sensor_probe(sensor_facts *f, const char *path, errmsg *e)
{
    int broken;
    libraw_data_t *raw = begin(path, &broken, e);
    if (!raw) return -1;
    int rc = take_facts(f, raw, path, e);
    libraw_close(raw);
    return rc;
}

/* ---- values ----------------------------------------------------------------------------------------------
 */

typedef struct levels {
    const unsigned *cblack;
    int rows, columns; /* of the pattern; 0: none */
    long black, white[4];
} levels;

static levels levels_of(const libraw_data_t *raw)
{
    const libraw_colordata_t *c = &raw->color;
    levels l = {.cblack = c->cblack, .black = (long)c->black};
    if (c->cblack[4] > 0 && c->cblack[5] > 0 && c->cblack[4] <= 4096 / c->cblack[5]) {
        l.rows = (int)c->cblack[4];
        l.columns = (int)c->cblack[5];
    }
    for (int i = 0; i < 4; i++) {
        l.white[i] = (long)c->maximum;
        long stated = (long)c->dng_levels.dng_whitelevel[i];
        int by_colour = stated > l.white[i] / 2 && stated < l.white[i];
        if (raw->idata.dng_version && by_colour) l.white[i] = stated;
        if (rawfile_white_lacks_black(raw, i)) l.white[i] = stated;
    }
    return l;
}

static inline long black_at(const levels *l, int colour, int x, int y)
{
    long b = l->black + (long)l->cblack[colour];
    if (l->columns) b += (long)l->cblack[PATTERN_AT + y % l->rows * l->columns + x % l->columns];
    return b;
}

/* Place of the value of pixel (x, y), channel c in what LibRaw unpacked. */
static inline unsigned stored(const libraw_data_t *raw, int x, int y, int c)
{
    const libraw_rawdata_t *d = &raw->rawdata;
    const libraw_image_sizes_t *s = &raw->sizes;
    size_t row = (size_t)(y + s->top_margin), col = (size_t)(x + s->left_margin);
    if (d->raw_image) return d->raw_image[row * (s->raw_pitch / 2) + col];
    if (d->color3_image) return d->color3_image[row * (s->raw_pitch / 6) + col][c];
    return d->color4_image[row * (s->raw_pitch / 8) + col][c];
}

static int has_values(const sensor_facts *f, const libraw_data_t *raw)
{
    const libraw_rawdata_t *d = &raw->rawdata;
    int fits = raw->sizes.top_margin + f->height <= raw->sizes.raw_height &&
               raw->sizes.left_margin + f->width <= raw->sizes.raw_width;
    return fits && (f->channels == 1 ? d->raw_image != NULL : d->color3_image || d->color4_image);
}

static void note_levels(sensor_facts *f, const levels *l, int colour, int filter, int x, int y)
{
    long black = black_at(l, filter, x, y), clip = l->white[filter] - black;
    if (f->clip[colour] == 0 || clip < f->clip[colour]) f->clip[colour] = (int)clip;
    if (f->black[colour] < 0 || black < f->black[colour]) f->black[colour] = (int)black;
}

static int copy_values(uint16_t *to, sensor_facts *f, libraw_data_t *raw, const char *path, errmsg *e)
{
    levels l = levels_of(raw);
    uint8_t filter_at[CFA_MOST * CFA_MOST]; /* LibRaw's numbers: its second green has levels of its own */
    int period_x = l.columns > CFA_MOST ? l.columns : CFA_MOST, grey = f->channels == 1 && !f->mosaic.columns;
    int period_y = l.rows > CFA_MOST ? l.rows : CFA_MOST, columns = f->mosaic.columns, rows = f->mosaic.rows;
    for (int i = 0; i < columns * rows; i++)
        filter_at[i] = (uint8_t)(libraw_COLOR(raw, i / columns, i % columns) & 3);
    for (int c = 0; c < 3; c++) {
        f->clip[c] = 0;
        f->black[c] = -1;
    }
    for (int y = 0; y < f->height; y++)
        for (int x = 0; x < f->width; x++)
            for (int k = 0; k < f->channels; k++, to++) {
                int filter = f->channels == 3 ? k : grey ? 0 : filter_at[y % rows * columns + x % columns];
                int colour = filter == 3 ? 1 : filter;
                long v = (long)stored(raw, x, y, k), black = black_at(&l, filter, x, y);
                if (x < period_x && y < period_y) note_levels(f, &l, colour, filter, x, y);
                *to = (uint16_t)(v >= l.white[filter] ? SENSOR_CLIPPED : v > black ? v - black : 0);
            }
    for (int c = 0; c < (grey ? 1 : 3); c++)
        if (f->clip[c] < 3)
            return err_set(e, "%s: expected a white level above black, found white %ld, black %d", path,
                           l.white[c], f->black[c]);
    return 0;
}

int sensor_read(uint16_t **values, sensor_facts *f, const char *path, errmsg *e)
{
    int broken, code = -1;
    sensor_facts now;
    uint16_t *v = NULL;
    libraw_data_t *raw = begin(path, &broken, e);
    if (!raw) return -1;
    int rc = libraw_unpack(raw);
    if (rc != LIBRAW_SUCCESS || broken) {
        err_set(e, "%s: broken camera raw file: %s", path, libraw_strerror(broken ? LIBRAW_DATA_ERROR : rc));
        goto done;
    }
    if (take_facts(&now, raw, path, e)) goto done;
    if (now.width != f->width || now.height != f->height || now.channels != f->channels) {
        err_set(e, "%s: expected %dx%d pixels of %d value(s) as its header says, found %dx%d of %d", path,
                f->width, f->height, f->channels, now.width, now.height, now.channels);
        goto done;
    }
    if (!has_values(&now, raw)) {
        err_set(e, "%s: expected the values of a sensor (%s), found a layout that isn't known", path,
                now.camera);
        goto done;
    }
    v = malloc((size_t)now.width * (size_t)now.height * (size_t)now.channels * sizeof *v);
    if (!v) {
        err_set(e, "%s: out of memory", path);
        goto done;
    }
    if (copy_values(v, &now, raw, path, e)) goto done;
    *f = now;
    *values = v;
    v = NULL;
    code = 0;
done:
    free(v);
    libraw_close(raw);
    return code;
}
