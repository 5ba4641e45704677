/*
 * list.c - panoramas named in a list, with the places where they were taken (views.h).
 */
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/place.h"
#include "base/textfile.h"
#include "image/image.h"
#include "vec3.h"
#include "views.h"

static const double pi = 3.14159265358979323846;
enum { MOST_VIEWS = 4096, MOST_LINE = 4096, LEAST_NUMBERS = 4 };

/* Columns run to the right in a panorama, to the left (azimuth upwards) here. */
static int take_pixels(view *v, img *im, const char *file, errmsg *e)
{
    const int ch = im->info.channels, colours = ch >= 3 ? 3 : 1;

    if (im->info.width != 2 * im->info.height)
        return err_set(e, "%s: expected a panorama twice as wide as high, found %d x %d", file,
                       im->info.width, im->info.height);
    img_linearise_srgb(im);
    v->nt = im->info.width, v->np = im->info.height, v->polar_max = pi;
    v->rgb = malloc((size_t)v->nt * (size_t)v->np * 3 * sizeof *v->rgb);
    if (!v->rgb) return err_set(e, "%s: no memory for its pixels", file);
    for (int y = 0; y < v->np; y++)
        for (int x = 0; x < v->nt; x++)
            for (int c = 0; c < 3; c++)
                v->rgb[3 * ((size_t)y * (size_t)v->nt + (size_t)(v->nt - 1 - x)) + (size_t)c] =
                    im->pix[(size_t)ch * ((size_t)y * (size_t)v->nt + (size_t)x) +
                            (size_t)(colours == 3 ? c : 0)];
    return 0;
}

static int load(view *v, const char *folder, const char *name, errmsg *e)
{
    char file[MOST_LINE * 2];
    img im;

    snprintf(file, sizeof file, "%s%s%s", *name == '/' ? "" : folder, *name == '/' ? "" : "/", name);
    if (img_load(&im, file, e)) return -1;
    const int bad = take_pixels(v, &im, file, e);
    img_free(&im);
    return bad;
}

static int one_line(view *v, char *line, const char *folder, const char *path, int number, errmsg *e)
{
    const char *rest;
    char *name;
    place p;

    if (place_of_line(&p, &name, line, &rest) < LEAST_NUMBERS)
        return err_set(
            e, "%s:%d: expected a picture, x y z and heading, maybe pitch and roll, found \"%s %.100s\"",
            path, number, line, rest);
    if (p.unknown)
        return err_set(e, "%s:%d: expected a heading, found ? (ilfpack --positions finds headings)", path,
                       number);
    snprintf(v->name, sizeof v->name, "%.250s", name);
    memcpy(v->at, p.at, sizeof v->at);
    place_axes(v->axis, &p);
    v->turned = 1;
    return load(v, folder, name, e);
}

static int all_lines(views *s, const char *text, const char *path, const char *folder, errmsg *e)
{
    textlines t = textlines_of(text);
    char line[MOST_LINE];

    while (textlines_next(line, sizeof line, &t)) {
        if (s->n == MOST_VIEWS) return err_set(e, "%s: expected at most %d pictures", path, MOST_VIEWS);
        view *more = realloc(s->v, (size_t)(s->n + 1) * sizeof *more);
        if (!more) return err_set(e, "%s: no memory", path);
        s->v = more;
        memset(&s->v[s->n], 0, sizeof *s->v);
        s->v[s->n].slot = s->n;
        s->n++;
        if (one_line(&s->v[s->n - 1], line, folder, path, t.number, e)) return -1;
    }
    return s->n >= 2 ? 0 : err_set(e, "%s: expected two pictures or more, found %d", path, s->n);
}

static void measure(views *s)
{
    for (int k = 0; k < s->n; k++) {
        v3_add(s->centre, s->centre, 1. / s->n, s->v[k].at);
        for (int i = 0; i < k; i++) {
            double b[3];
            v3_add(b, s->v[k].at, -1, s->v[i].at);
            s->size = fmax(s->size, v3_len(b));
        }
    }
    s->reach = s->size / 2, s->below = 1, s->mirrored = 1, s->nu = 1, s->nv = s->n;
    for (int c = 0; c < 3; c++) s->axes[c][c] = 1;
}

int views_of_list(views *s, const char *path, errmsg *e)
{
    char *text, *copy = strdup(path);

    memset(s, 0, sizeof *s);
    if (!copy) return err_set(e, "%s: no memory", path);
    int bad = text_read(&text, path, e);
    if (!bad) {
        bad = all_lines(s, text, path, dirname(copy), e);
        free(text);
    }
    free(copy);
    if (bad) {
        views_free(s);
        return -1;
    }
    measure(s);
    if (!(s->size > 0)) {
        views_free(s);
        return err_set(e, "%s: expected pictures from different places, found all at one", path);
    }
    return 0;
}
