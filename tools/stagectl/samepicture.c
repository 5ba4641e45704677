/* samepicture.c - see samepicture.h. */
#include "samepicture.h"

#include <math.h>
#include <stdlib.h>

#include "image/image.h"

enum { SIDE = 256 };

typedef struct small {
    int w, h, scale, full[2];
    double *grey;
} small;

static int small_load(small *s, const char *path, errmsg *e)
{
    const img_open_opts opts = {.keep_orientation = 1};
    img im;
    if (img_load_as(&im, path, &opts, e) != 0) return -1;
    const int w = im.info.width, h = im.info.height, c = im.info.channels, colours = c >= 3 ? 3 : 1;
    const int most = w > h ? w : h, f = (most + SIDE - 1) / SIDE;
    *s = (small){.w = w / f, .h = h / f, .scale = f, .full = {w, h}};
    s->grey = calloc((size_t)s->w * (size_t)s->h, sizeof *s->grey);
    if (!s->grey) {
        img_free(&im);
        return err_set(e, "%s: out of memory", path);
    }
    for (int y = 0; y < s->h * f; y++)
        for (int x = 0; x < s->w * f; x++) {
            const float *p = im.pix + ((size_t)y * (size_t)w + (size_t)x) * (size_t)c;
            double v = 0;
            for (int k = 0; k < colours; k++) v += isfinite(p[k]) ? (double)p[k] : 0;
            s->grey[(y / f) * s->w + x / f] += v / colours / f / f;
        }
    img_free(&im);
    return 0;
}

/* In the circle, with its neighbours. */
static int inside(const small *s, int x, int y, double circle)
{
    const double r = circle * fmin(s->full[0], s->full[1]) / 2 / s->scale - 1;
    if (x < 1 || y < 1 || x >= s->w - 1 || y >= s->h - 1) return 0;
    return !(circle > 0) ||
           hypot(x + 0.5 - s->full[0] / 2.0 / s->scale, y + 0.5 - s->full[1] / 2.0 / s->scale) <= r;
}

typedef struct moments {
    double n, a, b, aa, bb, ab; /* means; then sums of products of the deviations */
} moments;

static moments moments_of(const small *a, const small *b, double circle)
{
    moments m = {0};
    for (int pass = 0; pass < 2; pass++) {
        for (int y = 0; y < a->h; y++)
            for (int x = 0; x < a->w; x++) {
                if (!inside(a, x, y, circle)) continue;
                const double p = a->grey[y * a->w + x] - m.a, q = b->grey[y * a->w + x] - m.b;
                if (pass) {
                    m.aa += p * p;
                    m.bb += q * q;
                    m.ab += p * q;
                } else {
                    m.n++;
                    m.aa += p;
                    m.bb += q;
                }
            }
        if (pass || m.n < 1) break;
        m.a = m.aa / m.n;
        m.b = m.bb / m.n;
        m.aa = m.bb = 0;
    }
    return m;
}

static void displacement(double shift[2], const small *a, const small *b, const moments *m, double circle)
{
    double xx = 0, xy = 0, yy = 0, xd = 0, yd = 0;
    const double gain = sqrt(m->aa / m->bb);
    for (int y = 0; y < a->h; y++)
        for (int x = 0; x < a->w; x++) {
            if (!inside(a, x, y, circle)) continue;
            const double *p = a->grey + y * a->w + x;
            const double gx = (p[1] - p[-1]) / 2, gy = (p[a->w] - p[-a->w]) / 2;
            const double d = (b->grey[y * a->w + x] - m->b) * gain - (*p - m->a);
            xx += gx * gx;
            xy += gx * gy;
            yy += gy * gy;
            xd += gx * d;
            yd += gy * d;
        }
    const double det = xx * yy - xy * xy;
    shift[0] = shift[1] = 0;
    if (!(det > 1e-12 * xx * yy)) return;
    shift[0] = -(yy * xd - xy * yd) / det * a->scale;
    shift[1] = -(xx * yd - xy * xd) / det * a->scale;
}

int picture_differ(picture_difference *d, const char *pa, const char *pb, double circle, errmsg *e)
{
    small a, b;
    if (small_load(&a, pa, e) != 0) return -1;
    if (small_load(&b, pb, e) != 0) {
        free(a.grey);
        return -1;
    }
    int bad = 0;
    if (a.full[0] != b.full[0] || a.full[1] != b.full[1]) {
        bad = err_set(e, "%s: expected %dx%d pixels as %s has, found %dx%d", pb, a.full[0], a.full[1], pa,
                      b.full[0], b.full[1]);
    } else {
        const moments m = moments_of(&a, &b, circle);
        if (!(m.aa > 1e-12 * m.n * m.a * m.a) || !(m.bb > 1e-12 * m.n * m.b * m.b)) {
            bad = err_set(e, "%s: expected a picture that shows something, found one value only",
                          m.aa > 0 ? pb : pa);
        } else {
            const double rho = m.ab / sqrt(m.aa * m.bb);
            d->share = rho > 0 ? sqrt(fmax(0, 1 - rho * rho)) : 1;
            displacement(d->shift, &a, &b, &m, circle);
        }
    }
    free(a.grey);
    free(b.grey);
    return bad;
}

int picture_contrast(double *deviation, const char *path, double circle, errmsg *e)
{
    small a;
    if (small_load(&a, path, e) != 0) return -1;
    const moments m = moments_of(&a, &a, circle);
    *deviation = m.n > 0 ? sqrt(m.aa / m.n) : 0;
    free(a.grey);
    return 0;
}
