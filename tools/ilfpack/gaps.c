/*
 * gaps.c - see gaps.h.
 */
#include "gaps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/vec.h"
#include "image/holes.h"

enum { ASKED = 4 }; /* pictures that are joined for a texel: the nearest that saw it */
#define BESIDE .02  /* sizes of the plane: pictures nearer than that count alike */

static size_t index_of(const lightfield *f, int k, int x, int y)
{
    return ((size_t)k * (size_t)f->np + (size_t)y) * (size_t)f->nt + (size_t)x;
}

/* ---- growing -------------------------------------------------------------------------------------- */

static int touches(const lightfield *f, int k, int x, int y)
{
    for (int q = 0; q < 4; q++) {
        int i = x, j = y;
        if (lf_beside(&i, &j, f,
                      q == 0   ? 1
                      : q == 1 ? -1
                               : 0,
                      q == 2   ? 1
                      : q == 3 ? -1
                               : 0) &&
            f->unseen[index_of(f, k, i, j)])
            return 1;
    }
    return 0;
}

/* One step of a picture's holes over what is bright beside them; how many texels they took. */
static int grow(lightfield *f, int k, double limit)
{
    int n = 0;

    for (int y = 0; y < f->np; y++)
        for (int x = 0; x < f->nt; x++) {
            unsigned char *u = &f->unseen[index_of(f, k, x, y)];
            if (!*u && lf_lum(f, k, x, y) > limit && touches(f, k, x, y)) *u = 1, n++;
        }
    return n;
}

int gaps_close(lightfield *f, double limit, errmsg *e)
{
    const size_t texels = (size_t)f->np * (size_t)f->nt;
    float *seen = f->unseen ? malloc(texels * sizeof *seen) : NULL;
    int bad = f->unseen && !seen;

    for (int k = 0; k < f->n && f->unseen && !bad; k++) {
        int grown = 0, step;
        while ((step = grow(f, k, limit)) > 0) grown += step;
        for (size_t i = 0; i < texels; i++) seen[i] = !f->unseen[(size_t)k * texels + i];
        if (grown) bad = holes_fill(lf_texel(f, k, 0, 0), seen, f->nt, f->np, f->polar_max);
    }
    free(seen);
    return bad ? err_set(e, "no memory to fill holes") : 0;
}

/* ---- filling -------------------------------------------------------------------------------------- */

/* What picture k shows in direction d (field's), bilinear; 0 where that is a hole, a lamp, or below its map. */
static int look(double rgb[3], const lightfield *f, int k, const double d[3], double limit)
{
    double x, y;

    lf_place(&x, &y, f, k, d);
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;
    rgb[0] = rgb[1] = rgb[2] = 0;
    for (int q = 0; q < 4; q++) {
        int i = (int)fx, j = (int)fy;
        const double w = (q & 1 ? a : 1 - a) * (q & 2 ? b : 1 - b);
        if (!lf_beside(&i, &j, f, q & 1, q >> 1) || f->unseen[index_of(f, k, i, j)] ||
            lf_lum(f, k, i, j) > limit)
            return 0;
        for (int c = 0; c < 3; c++) rgb[c] += w * (double)lf_texel(f, k, i, j)[c];
    }
    return 1;
}

/* Numbers of the other pictures, the nearest to picture k first. */
static void by_distance(int *order, const lightfield *f, int k)
{
    double *away = f->n ? malloc((size_t)f->n * sizeof *away) : NULL;
    int n = 0;

    for (int q = 0; q < f->n && away; q++) {
        double v[3];
        int at = n;
        if (q == k) continue;
        v_sub(v, f->pos[q], f->pos[k]);
        const double d = v_len(v);
        for (; at > 0 && away[at - 1] > d; at--) away[at] = away[at - 1], order[at] = order[at - 1];
        away[at] = d, order[at] = q, n++;
    }
    order[n] = -1;
    free(away);
}

/* Join what the nearest pictures saw at a place of the surroundings; 0: none did. */
static int from_others(float *to, const lightfield *f, int k, const int *order, const double h[3],
                       double limit)
{
    double sum[3] = {0, 0, 0}, all = 0;

    for (int i = 0, n = 0; order[i] >= 0 && n < ASKED; i++) {
        double rgb[3], d[3], apart[3];
        v_sub(d, h, f->pos[order[i]]), v_sub(apart, f->pos[order[i]], f->pos[k]);
        if (!look(rgb, f, order[i], d, limit)) continue;
        const double w = 1 / (v_dot(apart, apart) + pow(BESIDE * f->size, 2));
        for (int c = 0; c < 3; c++) sum[c] += w * rgb[c];
        all += w, n++;
    }
    for (int c = 0; c < 3 && all > 0; c++) to[c] = (float)(sum[c] / all);
    return all > 0;
}

int gaps_fill(double *part, lightfield *f, const surroundings *around, double limit, errmsg *e)
{
    int *order = malloc(((size_t)f->n + 1) * sizeof *order);
    double filled = 0, all = 0;

    *part = 0;
    if (!order) return err_set(e, "no memory to fill holes");
    for (int k = 0; k < f->n && f->unseen; k++) {
        by_distance(order, f, k);
        for (int y = 0; y < f->np; y++)
            for (int x = 0; x < f->nt; x++) {
                double d[3], h[3];
                lf_direction(d, f, k, x + .5, y + .5);
                if (!f->unseen[index_of(f, k, x, y)] || d[2] <= 0) continue;
                surroundings_meet(h, around, f->pos[k], d);
                all += lf_texel_sr(f, y);
                if (from_others(lf_texel(f, k, x, y), f, k, order, h, limit)) filled += lf_texel_sr(f, y);
            }
    }
    free(order);
    *part = all > 0 ? filled / all : 0;
    return 0;
}
