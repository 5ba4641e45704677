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
        if (fabsf(p[i]) > half_max || (p[i] > 0 && p[i] < half_full)) return 0;
    return 1;
}

static const char *last_part(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* The images' names without folders, blanks between, in the order of the times. */
static char *image_names(const job *j)
{
    size_t need = 1;
    for (int k = 0; k < j->n; k++) need += strlen(j->shots[k].path) + 1;
    char *all = malloc(need), *at = all;
    for (int k = 0; all && k < j->n; k++) {
        at += sprintf(at, "%s%s", k ? " " : "", last_part(j->shots[k].path));
    }
    return all;
}

static float *bytes_as_floats(const uint8_t *b, size_t n)
{
    float *f = malloc(n * sizeof *f);
    for (size_t i = 0; f && i < n; i++) f[i] = b[i];
    return f;
}

/* 1, and 0 where no exposure has anything to say. */
static float *alpha_of(const uint8_t *flags, size_t n)
{
    float *a = malloc(n * sizeof *a);
    for (size_t i = 0; a && i < n; i++) a[i] = flags[i] & MERGE_MISSING ? 0 : 1;
    return a;
}

/* Seconds, f-number and ISO of each shot (0: not stated), and under their usual names where all have the
 * same: fishremap chooses a falloff by the f-number.  room: 3 n floats. */
static int attrs_of_shots(img_attr *to, float *room, const job *j)
{
    int n = 0, same_f = 1, same_iso = 1, any_f = 0, any_iso = 0;
    float *seconds = room, *f = room + j->n, *iso = room + 2 * j->n;
    for (int k = 0; k < j->n; k++) {
        const shot *s = &j->shots[k];
        seconds[k] = (float)s->seconds;
        f[k] = (float)s->f_number;
        iso[k] = (float)s->iso;
        same_f &= s->f_number == j->shots[0].f_number;
        same_iso &= s->iso == j->shots[0].iso;
        any_f |= f[k] > 0;
        any_iso |= iso[k] > 0;
    }
    to[n++] = (img_attr){.name = "hdrgen:seconds", .kind = IMG_ATTR_FLOATS, .f = seconds, .n = j->n};
    if (any_f) to[n++] = (img_attr){.name = "hdrgen:fNumbers", .kind = IMG_ATTR_FLOATS, .f = f, .n = j->n};
    if (any_iso) to[n++] = (img_attr){.name = "hdrgen:isos", .kind = IMG_ATTR_FLOATS, .f = iso, .n = j->n};
    if (any_f && same_f)
        to[n++] = (img_attr){.name = "aperture", .kind = IMG_ATTR_FLOAT, .v = {j->shots[0].f_number}};
    if (any_iso && same_iso)
        to[n++] = (img_attr){.name = "isoSpeed", .kind = IMG_ATTR_FLOAT, .v = {j->shots[0].iso}};
    if (j->facts.develop.orientation != 1)
        to[n++] =
            (img_attr){.name = "hdrgen:turnedBy", .kind = IMG_ATTR_INT, .v = {j->facts.develop.orientation}};
    return n;
}

/* .hdr names primaries only where they aren't the usual ones: few programs look. */
static int attrs_of_colours(img_attr *to, float balance[3], const job *j, const char *path)
{
    const develop_facts *d = &j->facts.develop;
    const float *xy = colour_chromaticities(j->opts.colour);
    size_t len = strlen(path);
    int n = 0, exr = len > 4 && strcmp(path + len - 4, ".exr") == 0;
    if (!d->camera) return 0;
    for (int c = 0; c < 3; c++) balance[c] = (float)d->balance[c];
    to[n++] = (img_attr){.name = "hdrgen:camera", .kind = IMG_ATTR_STRING, .s = d->camera};
    to[n++] = (img_attr){.name = "hdrgen:colour", .kind = IMG_ATTR_STRING, .s = colour_name(j->opts.colour)};
    to[n++] = (img_attr){.name = "hdrgen:whiteBalance", .kind = IMG_ATTR_FLOATS, .f = balance, .n = 3};
    to[n++] = (img_attr){.name = "hdrgen:whiteBalanceOf",
                         .kind = IMG_ATTR_STRING,
                         .s = d->balance_from >= 0 ? last_part(j->shots[d->balance_from].path)
                              : d->daylight        ? "daylight"
                                                   : "none"};
    if (xy && (exr || j->opts.colour != COLOUR_SRGB))
        to[n++] = (img_attr){.name = "chromaticities", .kind = IMG_ATTR_CHROMATICITIES, .f = xy, .n = 8};
    return n;
}

/* Per channel: the part of the light that was taken out, the most it can have been, the relative error; and
 * how it is spread: widths of the Gaussians (0: evenly), parts of each, channel by channel. */
static int attrs_of_flare(img_attr *to, const job *j)
{
    const flare_facts *f = &j->facts.flare;
    const int ch = j->radiance.info.channels, n = f->all.n;
    const struct {
        const char *name;
        const float *f;
        int n;
    } all[] = {{"hdrgen:flare", f->total, ch},
               {"hdrgen:flareMost", f->most, ch},
               {"hdrgen:flareError", f->error, ch},
               {"hdrgen:flareWidths", f->width, n},
               {"hdrgen:flareParts", f->part, ch * n}};
    int count = 0;
    for (; count < (int)(sizeof all / sizeof *all); count++)
        to[count] = (img_attr){
            .name = all[count].name, .kind = IMG_ATTR_FLOATS, .f = all[count].f, .n = all[count].n};
    return count;
}

/* What the first shot states of the panorama that it is (image.h): its part, its camera's pose.  text holds it. */
static int attrs_of_panorama(img_attr *to, char text[2][128], const job *j)
{
    const img_panorama *p = &frames_info(j->frames, 0)->pano;
    const double *q = p->shows_deg;
    int n = 0;
    if (q[0] != 0 || q[1] != 0) {
        snprintf(text[0], 128, "%.9g %.9g %.9g %.9g", q[0], q[1], q[2], q[3]);
        to[n++] = (img_attr){.name = "ilf:latlong", .kind = IMG_ATTR_STRING, .s = text[0]};
    }
    if (!(p->has_pose[0] | p->has_pose[1] | p->has_pose[2])) return n;
    text[1][0] = 0;
    for (int k = 0; k < 3; k++) {
        const size_t at = strlen(text[1]);
        if (p->has_pose[k]) snprintf(text[1] + at, 128 - at, "%s%.9g", k ? " " : "", p->pose_deg[k]);
        else snprintf(text[1] + at, 128 - at, "%sx", k ? " " : "");
    }
    to[n++] = (img_attr){.name = "ilf:pose", .kind = IMG_ATTR_STRING, .s = text[1]};
    return n;
}

int output_write(const job *j, const output_opts *o, output_type *type_used, errmsg *e)
{
    static const char *const sigma_names[2][3] = {{"sigma.Y"}, {"sigma.R", "sigma.G", "sigma.B"}};
    enum { MOST_PLANES = 6, ATTRS = 32 };
    const img_info *i = &j->radiance.info;
    size_t pixels = (size_t)i->width * (size_t)i->height, ch = (size_t)i->channels;
    img_plane planes[MOST_PLANES];
    int np = 0, code = -1;
    float *count = j->count ? bytes_as_floats(j->count, pixels) : NULL;
    float *flags = o->want_flags ? bytes_as_floats(j->flags, pixels) : NULL;
    float *alpha = j->facts.missing ? alpha_of(j->flags, pixels) : NULL;
    float *times = malloc(sizeof *times * (size_t)j->n), noise[9], balance[3];
    float *seconds = malloc(3 * sizeof *seconds * (size_t)j->n); /* then f-numbers, ISO */
    char *names = image_names(j), panorama[2][128];
    if ((j->count && !count) || (j->facts.missing && !alpha) || (o->want_flags && !flags) || !times ||
        !seconds || !names) {
        err_set(e, "%s: out of memory", o->path);
        goto done;
    }
    *type_used =
        o->type == OUTPUT_HALF && fits_half(j->radiance.pix, pixels * ch) ? OUTPUT_HALF : OUTPUT_FLOAT;
    for (size_t c = 0; j->sigma && c < ch; c++)
        planes[np++] = (img_plane){sigma_names[ch == 3][c], j->sigma + c, ch, IMG_FLOAT};
    if (alpha) planes[np++] = (img_plane){"A", alpha, 1, IMG_HALF};
    if (count) planes[np++] = (img_plane){"exposures", count, 1, IMG_HALF};
    if (flags) planes[np++] = (img_plane){"flags", flags, 1, IMG_HALF};
    for (int k = 0; k < j->n; k++) times[k] = (float)j->exposure[k];
    for (int c = 0; c < j->response.channels; c++) {
        noise[3 * c] = (float)j->noise[c].photon;
        noise[3 * c + 1] = (float)j->noise[c].read;
        noise[3 * c + 2] = (float)j->noise[c].code_var;
    }
    img_attr attrs[ATTRS] = {
        {.name = "hdrgen:times", .kind = IMG_ATTR_FLOATS, .f = times, .n = j->n},
        {.name = "hdrgen:images", .kind = IMG_ATTR_STRING, .s = names},
        {.name = "hdrgen:response", .kind = IMG_ATTR_STRING, .s = j->response.origin},
        {.name = "hdrgen:weight",
         .kind = IMG_ATTR_STRING,
         .s = j->opts.weight == MERGE_DEBEVEC ? "debevec" : "noise"},
        {.name = "hdrgen:noise", .kind = IMG_ATTR_FLOATS, .f = noise, .n = 3 * j->response.channels},
        {.name = "hdrgen:scale", .kind = IMG_ATTR_FLOAT, .v = {j->facts.scale}},
    };
    int na = 6;
    na += attrs_of_shots(attrs + na, seconds, j);
    na += attrs_of_colours(attrs + na, balance, j, o->path);
    na += attrs_of_panorama(attrs + na, panorama, j);
    if (j->opts.flare) na += attrs_of_flare(attrs + na, j);
    if (j->opts.patch[2] > 0 || j->opts.absolute) /* values are W/sr/m2: 179 lm/W is what white 1 is worth */
        attrs[na++] = (img_attr){.name = "whiteLuminance", .kind = IMG_ATTR_FLOAT, .v = {179}};
    img_write_opts w = {.type = *type_used == OUTPUT_HALF ? IMG_HALF : IMG_FLOAT,
                        .compression = o->compression,
                        .planes = planes,
                        .nplanes = np,
                        .attrs = attrs,
                        .nattrs = na,
                        .comment = o->command};
    code = img_write(&j->radiance, o->path, &w, e);
done:
    free(count);
    free(flags);
    free(alpha);
    free(times);
    free(seconds);
    free(names);
    return code;
}
