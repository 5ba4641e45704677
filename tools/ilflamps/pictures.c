/*
 * pictures.c - what stands in front of the walls in each probe's picture.
 */
#include "pictures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

enum { WITNESSES = 15 };
/* Part of a texel's darkening that counts as all: what is thinner than a texel must not vanish. */
#define PART .4f
/* z of directions looked at: lower ones hardly matter, and walls are seen obliquely. */
#define LOWEST .15

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Luminance over the wall's for every texel; 1 where it isn't looked at. */
static void ratios(float *out, const lightfield *f, const surroundings *s, int probe)
{
    for (int k = 0; k < f->nt * f->np; k++) {
        double d[3], x[3], v[WITNESSES];
        int n = 0;
        lf_direction(d, f, k % f->nt + .5, k / f->nt + .5);
        out[k] = 1;
        if (d[2] < LOWEST) continue;
        surroundings_meet(x, s, f->pos[probe], d);
        for (int w = 0; w < WITNESSES && n < WITNESSES; w++) {
            const int q = (probe + 1 + w * (f->n > WITNESSES ? f->n / WITNESSES : 1) + (w * w) % 3) % f->n;
            double e[3], px, py;
            v_sub(e, x, f->pos[q]);
            if (q == probe || e[2] < .1 * v_len(e)) continue;
            lf_place(&px, &py, f, e);
            v[n++] = lf_look(f, q, px, py);
        }
        if (n < 3) continue;
        qsort(v, (size_t)n, sizeof *v, by_value);
        out[k] = (float)(lf_lum(f, probe, k % f->nt, k / f->nt) / fmax(1e-12, v[n / 2]));
    }
}

int pictures_make(pictures *p, const lightfield *f, const surroundings *around, errmsg *e)
{
    const size_t texels = (size_t)f->nt * (size_t)f->np;
    long count[64] = {0}, all = 0;

    memset(p, 0, sizeof *p);
    p->nt = f->nt, p->np = f->np, p->around = around;
    p->opacity = malloc((size_t)f->n * texels * sizeof *p->opacity);
    if (!p->opacity) return err_set(e, "no memory for pictures of what hides");
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < f->n; k++) ratios(p->opacity + (size_t)k * texels, f, around, k);
    /* what hides is dark: a tenth of the texels that are clearly darker than the wall tell how dark */
    for (size_t k = 0; k < (size_t)f->n * texels; k++)
        if (p->opacity[k] < .6f) count[(int)fmaxf(0, p->opacity[k] / .6f * 64 * .999f)]++, all++;
    p->dark = .3;
    long sum = 0;
    for (int k = 0; k < 64 && all > 100; k++)
        if ((sum += count[k]) > all / 4) {
            p->dark = .6 * (k + .5) / 64;
            break;
        }
    for (size_t k = 0; k < (size_t)f->n * texels; k++)
        p->opacity[k] = fmaxf(0, fminf(1, (1 - p->opacity[k]) / (1 - (float)p->dark) / PART));
    return 0;
}

void pictures_add_lamp(pictures *p, const lamp *l, const lightfield *f)
{
    for (int i = 0; i < l->nfilled; i++) {
        const float *was = l->was + 4 * i, *left = f->rgb + 3 * l->filled[i];
        if (was[3] < .3f) continue;
        const double share = (ilf_luminance(was) - ilf_luminance(left)) /
                             ((double)was[3] * (l->s.radiance - ilf_luminance(left)));
        p->opacity[l->filled[i]] = (float)fmax(0, fmin(1, (1 - share) / (double)PART));
    }
}

void pictures_free(pictures *p)
{
    free(p->opacity);
    memset(p, 0, sizeof *p);
}
