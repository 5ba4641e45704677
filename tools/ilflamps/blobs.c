/*
 * blobs.c - the bright spots of each probe: texels over a threshold that touch, with a rim of one texel, less
 * the median of what lies two and three texels around them.
 */
#include "blobs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double median(double *v, int n)
{
    if (!n) return 0;
    qsort(v, (size_t)n, sizeof *v, by_value);
    return v[n / 2];
}

double blobs_median(const lightfield *f, int probe)
{
    enum { MOST = 4096 };
    double v[MOST];
    const int all = f->nt * f->np, step = all > MOST ? all / MOST + 1 : 1;
    int n = 0;

    for (int k = 0; k < all; k += step) v[n++] = lf_lum(f, probe, k % f->nt, k / f->nt);
    return median(v, n);
}

/* A spot being gathered: its texels and their distance (in texels) from the bright ones. */
typedef struct spot {
    int *at, *level, n;
    unsigned char
        *seen; /* per texel: 0 unseen, 1 bright, not yet taken, 2 taken by this spot, 3 bright of others */
} spot;

static void take(spot *s, int k, int level)
{
    s->at[s->n] = k, s->level[s->n++] = level;
    s->seen[k] |= 4;
}

/* All bright texels that hang together with the first, then `rims` rims of others. */
static void gather(spot *s, const lightfield *f, int first, int rims)
{
    s->n = 0;
    take(s, first, 0);
    for (int level = 0, head = 0, round = 0; round <= rims; round++, level = round) {
        const int end_of_round = round ? s->n : -1;
        for (; round ? head < end_of_round : head < s->n; head++)
            for (int dy = -1; dy <= 1; dy++)
                for (int dx = -1; dx <= 1; dx++) {
                    int x = s->at[head] % f->nt, y = s->at[head] / f->nt;
                    if (!lf_beside(&x, &y, f, dx, dy)) continue;
                    const int k = y * f->nt + x;
                    if (!(s->seen[k] & 4) && (round ? 1 : s->seen[k] & 1)) take(s, k, level);
                }
        if (!round) head = 0;
    }
}

static void untake(spot *s)
{
    for (int i = 0; i < s->n; i++) {
        s->seen[s->at[i]] &= 3;
        if (!s->level[i]) s->seen[s->at[i]] = 2;
    }
}

static void moments(blob *b, const spot *s, const lightfield *f, double ring)
{
    double sum[3] = {0, 0, 0}, d[3];

    b->flux = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < s->n; i++) {
            const int x = s->at[i] % f->nt, y = s->at[i] / f->nt;
            if (s->level[i] > 1) continue;
            const double w = (lf_lum(f, b->probe, x, y) - ring) * lf_texel_sr(f, y);
            lf_direction(d, f, b->probe, x + .5, y + .5);
            if (!pass) {
                b->flux += w;
                for (int k = 0; k < 3; k++) sum[k] += w * d[k];
                continue;
            }
            const double st = sin((y + .5) * f->dp), vp = f->dp * f->dp / 12,
                         vt = st * st * f->dt * f->dt / 12;
            const double t = (x + .5) * f->dt - 3.14159265358979323846, tall[3] = {d[0], d[1], d[2]};
            double et[3] = {-sin(t), cos(t), 0}, ep[3], g[3];
            lf_outward(et, f, b->probe);
            v_cross(ep, et, tall), v_sub(g, d, b->dir);
            for (int r = 0, m = 0; r < 3; r++)
                for (int c = r; c < 3; c++, m++)
                    b->spread[m] += w / b->flux * (g[r] * g[c] - vt * et[r] * et[c] - vp * ep[r] * ep[c]);
            if (!s->level[i]) b->reach = fmax(b->reach, v_len(g));
        }
        if (pass) break;
        memcpy(b->dir, sum, sizeof sum);
        if (b->flux > 0) v_unit(b->dir);
    }
}

static int add(bloblist *l, const blob *b, errmsg *e)
{
    if (l->n == l->room) {
        const int room = l->room ? 2 * l->room : 16;
        blob *more = realloc(l->b, (size_t)room * sizeof *more);
        if (!more) return err_set(e, "no memory for bright spots");
        l->b = more, l->room = room;
    }
    l->b[l->n++] = *b;
    return 0;
}

static int of_probe(bloblist *l, const lightfield *f, int probe, double over, spot *s, errmsg *e)
{
    const double limit = over * fmax(blobs_median(f, probe), 1e-30);
    const int all = f->nt * f->np;
    double *ring = malloc((size_t)all * sizeof *ring);
    int bad = ring ? 0 : err_set(e, "no memory for bright spots");

    for (int k = 0; !bad && k < all; k++) s->seen[k] = lf_lum(f, probe, k % f->nt, k / f->nt) > limit;
    for (int k = 0; !bad && k < all; k++) {
        blob b = {.probe = probe, .lamp = -1};
        int n = 0;
        if (s->seen[k] != 1) continue;
        gather(s, f, k, 3);
        for (int i = 0; i < s->n; i++) {
            if (s->level[i] > 1 && !(s->seen[s->at[i]] & 3))
                ring[n++] = lf_lum(f, probe, s->at[i] % f->nt, s->at[i] / f->nt);
            b.texels += !s->level[i];
        }
        moments(&b, s, f, median(ring, n));
        untake(s);
        if (b.flux > 0 && b.dir[2] > 0) bad = add(l, &b, e);
    }
    free(ring);
    return bad;
}

int blobs_find(bloblist *list, const lightfield *f, double over, errmsg *e)
{
    const size_t all = (size_t)f->nt * (size_t)f->np;
    bloblist *each = calloc((size_t)f->n, sizeof *each);
    int bad = each ? 0 : err_set(e, "no memory for bright spots");

    memset(list, 0, sizeof *list);
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < f->n; k++) {
        spot s = {malloc(all * sizeof(int)), malloc(all * sizeof(int)), 0, malloc(all)};
        errmsg mine;
        int wrong = bad;
        if (!wrong)
            wrong = s.at && s.level && s.seen ? of_probe(&each[k], f, k, over, &s, &mine)
                                              : err_set(&mine, "no memory for bright spots");
        free(s.at), free(s.level), free(s.seen);
        if (wrong && !bad) {
#pragma omp critical
            bad = err_set(e, "%s", mine.text);
        }
    }
    for (int k = 0; each && k < f->n; k++) {
        for (int i = 0; !bad && i < each[k].n; i++) bad = add(list, &each[k].b[i], e);
        free(each[k].b);
    }
    free(each);
    if (bad) free(list->b), memset(list, 0, sizeof *list);
    return bad;
}

double blobs_typical(const lightfield *f)
{
    double sum = 0;

    for (int k = 0; k < f->n; k++) sum += blobs_median(f, k) / f->n;
    return sum;
}
