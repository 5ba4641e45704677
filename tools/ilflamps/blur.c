/*
 * blur.c - see blur.h.
 *
 * One width for all probes: balls are fitted to the spots with several widths in turn, and that which leaves least
 * of all of them together is refined by a parabola.  (Width and the balls' sizes stand for each other in each
 * texel, but not in the shape of the edge.)
 */
#include "blur.h"

#include <math.h>
#include <string.h>

enum { WIDTHS = 6, MOST_ASKED = 6, LEAST_PROBES = 8 };
static const double WIDTH[WIDTHS] = {0, .3, .6, .9, 1.3, 1.8}; /* texels */
#define FITS   .4  /* rms misfit of bodies in pictures whose pixels' own pattern shows */
#define EVEN   .12 /* scatter of a lamp's light among probes that see all of it */
#define GAINS  .85 /* of the mean square misfit: a blur that leaves more is none */
#define PLACED .15 /* standard error of its distance: more is no place */

int blur_shows(const shape *s)
{
    const double scatter = s->sigma_radiance * sqrt(s->full), *c = s->l.centre;
    const double far = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);

    return s->full >= LEAST_PROBES && s->misfit < FITS && scatter < EVEN &&
           (s->l.far || s->sigma_position < PLACED * far);
}

/* Sum of squares of the asked lamps' misfits at a width, or -1. */
static double all_misfits(lightfield *f, const int *asked, int n, double width, const centre *c,
                          const bloblist *list, double limit)
{
    double sum = 0;
    shape s;

    f->blur = width * f->dp;
    for (int i = 0; i < n; i++) {
        const int r = shape_fit_ball(&s, &c[asked[i]], asked[i], list, f, limit);
        if (r < 0) return -1;
        sum += r ? 1 : s.misfit * s.misfit;
    }
    return sum;
}

/* The least of a parabola through the least of values and its neighbours. */
static double least(const double *y, int *at)
{
    int k = 0;

    for (int i = 1; i < WIDTHS; i++)
        if (y[i] < y[k]) k = i;
    *at = k;
    if (k == 0 || k == WIDTHS - 1) return WIDTH[k];
    const double a = WIDTH[k - 1] - WIDTH[k], b = WIDTH[k + 1] - WIDTH[k], p = y[k - 1] - y[k],
                 q = y[k + 1] - y[k];
    return WIDTH[k] + .5 * (a * a * q - b * b * p) / (a * q - b * p);
}

int blur_find(blurred *b, lightfield *f, const unsigned char *use, const centre *c, int n,
              const bloblist *list, double limit)
{
    int asked[MOST_ASKED], many = 0, k;
    double y[WIDTHS];

    memset(b, 0, sizeof *b);
    f->blur = WIDTH[1] * f->dp;
    for (int i = 0; i < n && many < MOST_ASKED; i++) {
        shape s;
        if (!use[i]) continue;
        const int r = shape_fit_ball(&s, &c[i], i, list, f, limit);
        if (r < 0) return f->blur = 0, -1;
        if (!r && blur_shows(&s)) asked[many++] = i;
    }
    f->blur = 0;
    for (int i = 0; i < WIDTHS && many; i++)
        if ((y[i] = all_misfits(f, asked, many, WIDTH[i], c, list, limit)) < 0) return f->blur = 0, -1;
    f->blur = 0;
    if (!many) return 0;
    const double width = least(y, &k);
    if (!k || y[k] > GAINS * y[0]) return 0;
    f->blur = b->width = width * f->dp, b->lamps = many;
    b->sharp = sqrt(y[0] / many), b->misfit = sqrt(y[k] / many);
    return 0;
}
