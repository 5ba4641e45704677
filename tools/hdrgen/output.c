/*
 * output.c - see output.h.
 */
#include "output.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const float half_max = 65504, half_full = 6.1e-5f; /* below this half loses bits */

static int fits_half(const float *p, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (p[i] > half_max || (p[i] > 0 && p[i] < half_full))
            return 0;
    return 1;
}

/* The images' names without folders, blanks between, in the order of the times. */
static char *image_names(const job *j)
{
    size_t need = 1;
    for (int k = 0; k < j->n; k++)
        need += strlen(j->shots[k].path) + 1;
    char *all = malloc(need), *at = all;
    for (int k = 0; all && k < j->n; k++) {
        const char *slash = strrchr(j->shots[k].path, '/'), *name = slash ? slash + 1 : j->shots[k].path;
        at += sprintf(at, "%s%s", k ? " " : "", name);
    }
    return all;
}

static float *bytes_as_floats(const uint8_t *b, size_t n)
{
    float *f = malloc(n * sizeof *f);
    for (size_t i = 0; f && i < n; i++)
        f[i] = b[i];
    return f;
}

/* 1, and 0 where no exposure has anything to say. */
static float *alpha_of(const uint8_t *flags, size_t n)
{
    float *a = malloc(n * sizeof *a);
    for (size_t i = 0; a && i < n; i++)
        a[i] = flags[i] & MERGE_MISSING ? 0 : 1;
    return a;
}

int output_write(const job *j, const output_opts *o, output_type *type_used, errmsg *e)
{
    static const char *const sigma_names[2][3] = {{"sigma.Y"}, {"sigma.R", "sigma.G", "sigma.B"}};
    enum { MOST_PLANES = 6, ATTRS = 7 };
    const img_info *i = &j->radiance.info;
    size_t pixels = (size_t)i->width * (size_t)i->height, ch = (size_t)i->channels;
    img_plane planes[MOST_PLANES];
    int np = 0, code = -1;
    float *count = j->count ? bytes_as_floats(j->count, pixels) : NULL;
    float *flags = o->want_flags ? bytes_as_floats(j->flags, pixels) : NULL;
    float *alpha = j->facts.missing ? alpha_of(j->flags, pixels) : NULL;
    float *times = malloc(sizeof *times * (size_t)j->n), noise[9];
    char *names = image_names(j);
    if ((j->count && !count) || (j->facts.missing && !alpha) || (o->want_flags && !flags) || !times || !names) {
        err_set(e, "%s: out of memory", o->path);
        goto done;
    }
    *type_used = o->type == OUTPUT_HALF && fits_half(j->radiance.pix, pixels * ch) ? OUTPUT_HALF : OUTPUT_FLOAT;
    for (size_t c = 0; j->sigma && c < ch; c++)
        planes[np++] = (img_plane){sigma_names[ch == 3][c], j->sigma + c, ch, IMG_FLOAT};
    if (alpha)
        planes[np++] = (img_plane){"A", alpha, 1, IMG_HALF};
    if (count)
        planes[np++] = (img_plane){"exposures", count, 1, IMG_HALF};
    if (flags)
        planes[np++] = (img_plane){"flags", flags, 1, IMG_HALF};
    for (int k = 0; k < j->n; k++)
        times[k] = (float)j->exposure[k];
    for (int c = 0; c < j->response.channels; c++) {
        noise[3 * c] = (float)j->noise[c].photon;
        noise[3 * c + 1] = (float)j->noise[c].read;
        noise[3 * c + 2] = (float)j->noise[c].code_var;
    }
    img_attr attrs[ATTRS] = {
        {.name = "hdrgen:times", .kind = IMG_ATTR_FLOATS, .f = times, .n = j->n},
        {.name = "hdrgen:images", .kind = IMG_ATTR_STRING, .s = names},
        {.name = "hdrgen:response", .kind = IMG_ATTR_STRING, .s = j->response.origin},
        {.name = "hdrgen:weight", .kind = IMG_ATTR_STRING,
         .s = j->opts.weight == MERGE_DEBEVEC ? "debevec" : "noise"},
        {.name = "hdrgen:noise", .kind = IMG_ATTR_FLOATS, .f = noise, .n = 3 * j->response.channels},
        {.name = "hdrgen:scale", .kind = IMG_ATTR_FLOAT, .v = {j->facts.scale}},
    };
    int na = 6;
    if (j->opts.patch[2] > 0 || j->opts.absolute) /* values are W/sr/m2: 179 lm/W is what white 1 is worth */
        attrs[na++] = (img_attr){.name = "whiteLuminance", .kind = IMG_ATTR_FLOAT, .v = {179}};
    img_write_opts w = {.type = *type_used == OUTPUT_HALF ? IMG_HALF : IMG_FLOAT, .compression = o->compression,
                        .planes = planes, .nplanes = np, .attrs = attrs, .nattrs = na, .comment = o->command};
    code = img_write(&j->radiance, o->path, &w, e);
done:
    free(count);
    free(flags);
    free(alpha);
    free(times);
    free(names);
    return code;
}
