/*
 * aside.c - see aside.h.  These files lie as the series' pixels do in theirs: orientation tags are not
 * followed.
 */
#include "aside.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "finish.h"

/* A picture that must have the size of the series; values as relative light. */
static int load_aside(img *im, const job *j, const char *path, int channels, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    static const img_open_opts as_stored = {.keep_orientation = 1}; /* as the series' pixels lie */
    if (img_load_as(im, path, &as_stored, e)) return -1;
    if (im->info.width == f->width && im->info.height == f->height &&
        (channels == 0 || (im->info.channels >= 3 ? 3 : 1) == channels))
        return 0;
    err_set(e, "%s: expected %dx%d pixels%s as the series has, found %dx%d", path, f->width, f->height,
            channels == 3   ? " in colour"
            : channels == 1 ? " in grey"
                            : "",
            im->info.width, im->info.height);
    img_free(im);
    return -1;
}

/* The flat field as the sensor's values, clipped ones refused. */
static int load_raw_flat(img *flat, const job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    sensor_facts s;
    uint16_t *values = NULL;
    img_info info;
    const char *path = j->opts.flat;
    if (img_probe(&info, path, e)) return -1;
    if (strcmp(info.format, "raw") != 0)
        return err_set(e, "%s: expected a flat field in camera raw as the series is, found %s", path,
                       info.format);
    if (sensor_probe(&s, path, e)) return -1;
    if (s.width != f->width || s.height != f->height || s.channels != 1 ||
        memcmp(&s.mosaic, j->mosaic, sizeof s.mosaic) != 0)
        return err_set(e, "%s: expected %dx%d photosites with the series' colour filters, found %dx%d%s",
                       path, f->width, f->height, s.width, s.height, s.channels == 1 ? "" : " without");
    if (img_alloc(flat, s.width, s.height, 1, e)) return -1;
    if (sensor_read(&values, &s, path, e)) {
        img_free(flat);
        return -1;
    }
    int64_t clipped = 0, n = (int64_t)s.width * s.height;
    for (int64_t i = 0; i < n; i++) {
        flat->pix[i] = values[i];
        clipped += values[i] == SENSOR_CLIPPED;
    }
    free(values);
    if (clipped * 1000 <= n) return 0;
    img_free(flat);
    return err_set(e, "%s: expected a flat field that is not clipped, found %lld clipped photosites", path,
                   (long long)clipped);
}

int aside_heal(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t pixels = (size_t)f->width * (size_t)f->height;
    img mask;
    if (load_aside(&mask, j, j->opts.hot, 0, e)) return -1;
    uint8_t *marked = calloc(pixels, 1);
    int from = mask.info.channels, step = j->mosaic ? j->mosaic->columns : 1;
    for (size_t i = 0; marked && i < pixels; i++) {
        for (int c = 0; c < (from >= 3 ? 3 : 1); c++) marked[i] |= mask.pix[i * (size_t)from + (size_t)c] > 0;
        j->facts.healed += marked[i];
    }
    img_free(&mask);
    if (!marked) return err_set(e, "out of memory");
    heal_pixels(j->radiance.pix, f->channels, f->width, f->height, marked, step);
    if (j->sigma) heal_pixels(j->sigma, f->channels, f->width, f->height, marked, step);
    free(marked);
    return 0;
}

/* A flat field of the same camera's raw values, or of as many channels as are merged; as light. */
static int load_flat(img *flat, int ch, const job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    if (frames_sensor(j->frames, 0) && j->mosaic && ch == 1) return load_raw_flat(flat, j, e);
    if (load_aside(flat, j, j->opts.flat, ch, e)) return -1;
    int from = flat->info.channels;
    for (int64_t i = 0; i < (int64_t)f->width * f->height; i++)
        for (int c = 0; c < ch; c++) {
            float v = flat->pix[i * from + c];
            if (flat->info.coded) { /* codes of the same camera */
                const response *r = &j->response;
                double z = j->opts.bits ? fmin((double)v, r->max_code)
                                        : (double)v * r->max_code / flat->info.max_code;
                v = (float)r->finv[j->mosaic ? cfa_at(j->mosaic, (int)(i % f->width), (int)(i / f->width))
                                             : c][(int)(z + 0.5)];
            }
            flat->pix[i * ch + c] = v;
        }
    return 0;
}

/* Each colour of a mosaic to mean 1, so that the flat field's own colour does not matter. */
static void level_colours(float *flat, const cfa *mosaic, int width, int height)
{
    double sum[3] = {0}, n[3] = {0};
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            int c = cfa_at(mosaic, x, y);
            sum[c] += (double)flat[(size_t)y * (size_t)width + (size_t)x];
            n[c]++;
        }
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            int c = cfa_at(mosaic, x, y);
            float *v = &flat[(size_t)y * (size_t)width + (size_t)x];
            *v = (float)((double)*v * n[c] / sum[c]);
        }
}

int aside_flatten(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    img flat;
    if (load_flat(&flat, f->channels, j, e)) return -1;
    if (j->mosaic) level_colours(flat.pix, j->mosaic, f->width, f->height);
    int bad = apply_flat(j->radiance.pix, j->sigma, flat.pix, f->channels, (int64_t)f->width * f->height,
                         j->opts.flat, e);
    img_free(&flat);
    return bad;
}
