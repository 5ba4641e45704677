/*
 * picture.c - the plane with each lamp's light on it, and a side view.
 */
#include "picture.h"

#include <math.h>

#include "image/image.h"
#include "vec.h"

enum { PANEL = 192, GAP = 8, SIDE = 128, RAYS = 16 };

static void dot(img *im, int x, int y, double r, double g, double b)
{
    if (x < 0 || y < 0 || x >= im->info.width || y >= im->info.height) return;
    float *p = im->pix + 3 * ((size_t)y * (size_t)im->info.width + (size_t)x);
    p[0] = (float)r, p[1] = (float)g, p[2] = (float)b;
}

/* Share of the lamp that arrives at a place, as modelled. */
static double share(const ilf_luminaire *l, const double o[3])
{
    double sum = 0, w = 0;

    for (int k = 0; k < RAYS; k++) {
        double d[3];
        const double pdf = ilf_luminaire_sample(d, l, o, (k + .5) / RAYS, fmod((k + .5) * .618034, 1));
        if (pdf <= 0 || d[2] <= 0) continue;
        sum += ilf_luminaire_pass(l, o, d) / pdf, w += 1 / pdf;
    }
    return w > 0 ? sum / w : 0;
}

static double place(const lightfield *f, int pixel)
{
    return f->size * (1.5 * (pixel + .5) / PANEL - .25);
}

static int pixel_of(const lightfield *f, double x)
{
    return (int)((x / f->size + .25) / 1.5 * PANEL);
}

static void from_above(img *im, int x0, const found *it, const lightfield *f)
{
    for (int y = 0; y < PANEL; y++)
        for (int x = 0; x < PANEL; x++) {
            const double o[3] = {place(f, x), place(f, PANEL - 1 - y), 0}, v = fmin(1, share(&it->l.s.l, o));
            const int inside = o[0] >= 0 && o[0] <= f->len_u && o[1] >= 0 && o[1] <= f->len_v;
            dot(im, x0 + x, GAP + y, 240 * v + (inside ? 0 : 15), 240 * v, 240 * v);
        }
    for (int k = 0; k < f->n; k++) {
        const double v = fmax(0, fmin(1, it->l.seen[k])) * 255;
        const int x = x0 + pixel_of(f, f->pos[k][0]), y = GAP + PANEL - 1 - pixel_of(f, f->pos[k][1]);
        const int big = f->nu > 24 ? 1 : 3;
        for (int b = -big; b <= big; b++)
            for (int a = -big; a <= big; a++) {
                const int rim = big > 1 && (a == -big || a == big || b == -big || b == big);
                dot(im, x + a, y + b, rim ? 70 : v, rim ? 120 : v, rim ? 200 : v);
            }
    }
}

static void from_beside(img *im, int x0, const found *it, const lightfield *f)
{
    const ilf_luminaire *l = &it->l.s.l;
    const double reach = fmax(f->size, fmin(20 * f->size, v_len(l->centre))) * 1.3, scale = SIDE / reach;
    const int floor_y = 2 * GAP + PANEL + SIDE - 1, mid = x0 + PANEL / 2;
    const double brightest = fmax(1e-9, fmax((double)l->rgb[0], fmax((double)l->rgb[1], (double)l->rgb[2])));

    for (int x = 0; x < PANEL; x++) dot(im, x0 + x, floor_y, 60, 60, 60);
    for (int x = (int)(-f->len_u / 2 * scale); x <= (int)(f->len_u / 2 * scale); x++)
        for (int t = 0; t < 2; t++) dot(im, mid + x, floor_y - t, 90, 140, 220);
    if (it->best.height > 0)
        for (int x = 0; x < PANEL; x++)
            if (x / 4 % 2) dot(im, x0 + x, floor_y - (int)(it->best.height * scale), 200, 90, 60);
    const int lx = mid + (int)((l->centre[0] - f->len_u / 2) * scale),
              ly = floor_y - (int)(l->centre[2] * scale);
    for (int b = -4; b <= 4; b++)
        for (int a = -4; a <= 4; a++)
            if (a * a + b * b <= 18 && lx + a >= x0 && lx + a < x0 + PANEL && ly + b > GAP + PANEL)
                dot(im, lx + a, ly + b, 255 * (double)l->rgb[0] / brightest,
                    255 * (double)l->rgb[1] / brightest, 255 * (double)l->rgb[2] / brightest);
}

int picture_write(const char *path, const analysis *a, errmsg *e)
{
    int n = 0, x = GAP;
    img im;

    for (int i = 0; i < a->n; i++) n += a->lamps[i].fate == TAKEN;
    if (img_alloc(&im, GAP + (n ? n : 1) * (PANEL + GAP), 3 * GAP + PANEL + SIDE, 3, e)) return -1;
    for (size_t k = 0; k < (size_t)im.info.width * (size_t)im.info.height * 3; k++) im.pix[k] = 24;
    for (int i = 0; i < a->n; i++) {
        if (a->lamps[i].fate != TAKEN) continue;
        from_above(&im, x, &a->lamps[i], &a->f), from_beside(&im, x, &a->lamps[i], &a->f);
        x += PANEL + GAP;
    }
    im.info.coded = 1, im.info.max_code = 255;
    const int bad = img_write(&im, path, NULL, e);
    img_free(&im);
    return bad;
}
