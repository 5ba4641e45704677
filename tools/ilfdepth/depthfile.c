/*
 * depthfile.c - maps of distances as an OpenEXR picture.
 */
#include "depthfile.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "feature.h"
#include "image/image.h"

typedef struct corner {
    int k;
    float weight;
} corner;

/* The four cells round a place, weighted by nearness in the picture and by likeness. */
static void corners(corner c[4], const float f[4], const float (*cell)[4], const depthmap *m, double x,
                    double y)
{
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;

    for (int i = 0; i < 4; i++) {
        int u = (int)fx + (i & 1), v = (int)fy + (i >> 1);
        if (v < 0) v = 0, u += m->w / 2;
        if (v >= m->h) v = m->h - 1;
        u = ((u % m->w) + m->w) % m->w;
        c[i].k = v * m->w + u;
        c[i].weight = (float)((i & 1 ? a : 1 - a) * (i >> 1 ? b : 1 - b)) + 1e-4f;
        c[i].weight *= expf(-8 * fminf(2, feature_differ(f, cell[c[i].k])));
    }
}

static void one_texel(float *far, float *sure, float *error, const corner c[4], const depthmap *m,
                      float farthest)
{
    float sum = 0, near = 0, ok = 0, err = 0, lo = 1e30f, hi = 0;
    int best = 0;

    for (int i = 0; i < 4; i++) {
        const float r = m->near[c[i].k];
        sum += c[i].weight, near += c[i].weight * r, ok += c[i].weight * m->sure[c[i].k];
        err += c[i].weight * m->error[c[i].k], lo = fminf(lo, r), hi = fmaxf(hi, r);
        if (c[i].weight > c[best].weight) best = i;
    }
    near /= sum, ok /= sum, err /= sum;
    if (hi > 1.1f * lo) near = m->near[c[best].k], ok = m->sure[c[best].k], err = m->error[c[best].k];
    *far = near * farthest > 1 ? 1 / near : farthest;
    *sure = ok, *error = fminf(1, err * *far);
}

/* A lamp that was taken out of the field stands where its file says. */
static void lamp_before(float *far, float *sure, float *error, const double o[3], const double d[3],
                        const views *s)
{
    for (int k = 0; k < s->n_lamps; k++) {
        const ilf_luminaire *l = &s->lamps[k];
        double t;
        if (l->far || !ilf_luminaire_hit(&t, l, o, d) || t >= (double)*far) continue;
        *far = (float)t, *sure = 1, *error = (float)fmin(1, l->error_position / t);
    }
}

void depthfile_fine(float *far, float *sure, float *error, const depthmap *m, const views *s)
{
    const view *v = &s->v[m->view];
    const int n = m->w * m->h;
    float(*cell)[4] = malloc((size_t)n * sizeof *cell);

    for (int k = 0; k < n && cell; k++) {
        double d[3];
        depthmap_direction(d, m, s, k % m->w, k / m->w);
        const float e[3] = {(float)d[0], (float)d[1], (float)d[2]};
        feature_look(cell[k], v, e);
    }
    for (int y = 0; y < v->np && cell; y++)
        for (int x = 0; x < v->nt; x++) {
            const size_t at = (size_t)y * (size_t)v->nt + (size_t)x;
            double d[3];
            corner c[4];
            float f[4];
            view_direction(d, v, v->nt, v->np, x + .5, y + .5);
            const float e[3] = {(float)d[0], (float)d[1], (float)d[2]};
            feature_look(f, v, e);
            corners(c, f, (const float(*)[4])cell, m, (x + .5) * m->w / v->nt, (y + .5) * m->h / v->np);
            one_texel(far + at, sure + at, error + at, c, m, (float)(1e4 * s->size));
            lamp_before(far + at, sure + at, error + at, v->at, d, s);
        }
    free(cell);
}

/* One map's texels to its place in the mosaic; panoramas are turned back to how they came. */
static int place(img *im, float *sure, float *error, const depthmap *m, const views *s, int nt, int np,
                 errmsg *e)
{
    const view *v = &s->v[m->view];
    const int i = v->slot % s->nu, j = v->slot / s->nu;
    const size_t n = (size_t)v->nt * (size_t)v->np;
    float *room = malloc(3 * n * sizeof *room);

    if (!room) return err_set(e, "no memory for maps of distances");
    depthfile_fine(room, room + n, room + 2 * n, m, s);
    for (int y = 0; y < v->np; y++)
        for (int x = 0; x < v->nt; x++) {
            const size_t from = (size_t)y * (size_t)v->nt + (size_t)(s->mirrored ? v->nt - 1 - x : x);
            const size_t to = ((size_t)j * (size_t)np + (size_t)y) * (size_t)im->info.width +
                              (size_t)i * (size_t)nt + (size_t)x;
            im->pix[to] = room[from], sure[to] = room[n + from], error[to] = room[2 * n + from];
        }
    free(room);
    return 0;
}

static int write_picture(const char *path, const img *im, const float *sure, const float *error,
                         const char *line, errmsg *e)
{
    const img_plane planes[] = {{"confidence", sure, 1, IMG_HALF}, {"error", error, 1, IMG_HALF}};
    const img_attr attr = {.name = "comments", .kind = IMG_ATTR_STRING, .s = line};
    const img_write_opts opts = {
        .type = IMG_FLOAT, .planes = planes, .nplanes = 2, .attrs = &attr, .nattrs = 1};

    return img_write(im, path, &opts, e);
}

int depthfile_write(const char *path, const depthmap *maps, int n, const views *s, const char *line,
                    errmsg *e)
{
    int nt = 0, np = 0, bad;
    img im;

    for (int k = 0; k < s->n; k++) {
        nt = nt > s->v[k].nt ? nt : s->v[k].nt;
        np = np > s->v[k].np ? np : s->v[k].np;
    }
    if (img_alloc(&im, nt * s->nu, np * s->nv, 1, e)) return -1;
    const size_t all = (size_t)im.info.width * (size_t)im.info.height;
    float *sure = calloc(2 * all, sizeof *sure);
    bad = sure ? 0 : err_set(e, "no memory for maps of distances");
    for (int k = 0; k < n && !bad; k++) bad = place(&im, sure, sure + all, &maps[k], s, nt, np, e);
    if (!bad) bad = write_picture(path, &im, sure, sure + all, line, e);
    free(sure);
    img_free(&im);
    return bad;
}
