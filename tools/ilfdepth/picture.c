/*
 * picture.c - pictures, distances and how sure they are, side by side.
 */
#include "picture.h"

#include <math.h>

#include "feature.h"
#include "image/image.h"

enum { ROWS = 4, GAP = 8 };

static void dot(img *im, int x, int y, double r, double g, double b)
{
    float *p = im->pix + 3 * ((size_t)y * (size_t)im->info.width + (size_t)x);

    p[0] = (float)(255 * fmax(0, fmin(1, r))), p[1] = (float)(255 * fmax(0, fmin(1, g))),
    p[2] = (float)(255 * fmax(0, fmin(1, b)));
}

/* Red, yellow, green, blue from 0 to 1. */
static void rainbow(img *im, int x, int y, double v)
{
    dot(im, x, y, 2 - 4 * fabs(v - .1), 1.7 - 4 * fabs(v - .45), 1.7 - 3.5 * fabs(v - .85));
}

static double mean_log(const depthmap *m, const views *s)
{
    double sum = 0;
    int n = 0;

    for (int k = 0; k < m->w * m->h; k++) {
        double d[3];
        float f[4];
        depthmap_direction(d, m, s, k % m->w, k / m->w);
        const float e[3] = {(float)d[0], (float)d[1], (float)d[2]};
        if (feature_look(f, &s->v[m->view], e)) sum += (double)f[1], n++;
    }
    return n ? sum / n : 0;
}

static void one_row(img *im, int y0, const depthmap *m, const views *s, double most)
{
    const double mean = mean_log(m, s);

    for (int k = 0; k < m->w * m->h; k++) {
        const int x = s->mirrored ? m->w - 1 - k % m->w : k % m->w, y = y0 + k / m->w;
        double d[3], c[3] = {0};
        float f[4];
        depthmap_direction(d, m, s, k % m->w, k / m->w);
        const float e[3] = {(float)d[0], (float)d[1], (float)d[2]};
        if (feature_look(f, &s->v[m->view], e))
            for (int i = 0; i < 3; i++) c[i] = 1 / (1 + exp(mean - (double)f[i]));
        dot(im, GAP + x, y, c[0], c[1], c[2]);
        rainbow(im, 2 * GAP + m->w + x, y, fmax(0, 1 - (double)m->near[k] / most));
        const double sure = (double)m->sure[k];
        dot(im, 3 * GAP + 2 * m->w + x, y, sure, sure, sure);
    }
}

/* About the usual nearness of a map: what is three times as near is all red. */
static double usual(const depthmap *m)
{
    double sum = 1e-30;

    for (int k = 0; k < m->w * m->h; k++) sum += sqrt((double)m->near[k]);
    return pow(sum / (m->w * m->h), 2);
}

int picture_write(const char *path, const process *q, errmsg *e)
{
    const int rows = q->s.n < ROWS ? q->s.n : ROWS;
    img im;

    if (img_alloc(&im, 4 * GAP + 3 * q->p.w, GAP + rows * (q->p.h + GAP), 3, e)) return -1;
    for (size_t k = 0; k < (size_t)im.info.width * (size_t)im.info.height * 3; k++) im.pix[k] = 24;
    const double most = 3 * usual(&q->maps[0]);
    for (int k = 0; k < rows; k++)
        one_row(&im, GAP + k * (q->p.h + GAP), &q->maps[rows > 1 ? k * (q->s.n - 1) / (rows - 1) : 0], &q->s,
                most);
    im.info.coded = 1, im.info.max_code = 255;
    const int bad = img_write(&im, path, NULL, e);
    img_free(&im);
    return bad;
}
