/*
 * circle.c - search of a circle in a picture (circle.h).
 *
 * The picture is searched three times: as it is; mirrored and smaller; mirrored and softer.  None of these
 * moves a rim that is there, while what looks like one by chance, or because of where the pixels lie,
 * changes: a circle on which the three don't agree is refused, however strong.
 */
#include "circle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "circlelook.h"
#include "vision/circles.h"

#define LOOKS   3
#define LARGE   1100 /* pixels, longer side of the copies at most; the second one is SMALLER times that, */
#define SMALLER 0.72 /* or the picture's own, */
#define LEAST_R 110  /* pixels: but does not make a circle smaller than this, if .85 of the size is enough */
#define SOFT    90   /* radii: standard deviation of the third copy's blur */

/* What is not refused; measured on photographs with bench/circles/evaluate.py.  AGREE, share of the radius:
 * between the first two looks, with the part of a pixel that no edge is sure of.  SURE, share of the rim that
 * is seen: with less, the fit is looser than the looks tell, and they must agree better.  Blur moves a rim
 * that has reflections beside it: hence AGREE_SOFT. */
#define AGREE          0.02
#define AGREE_SOFT     0.03
#define SURE           0.75
#define LEAST_STRENGTH 0.45
#define LEAST_MARGIN   0.1  /* over another circle */
#define LEAST_SEEN     0.4  /* of the circumference in the picture */
#define MOST_OUTSIDE   0.22 /* rings around it: it lies inside of something round */
#define MOST_WITHIN    0.75 /* a circle within it: a mirror in a flange, a plate, a wheel */
#define MOST_NESTED    0.55 /* rings within it: it lies around something round */

static const char by_hand[] = "say where it is: --centre X,Y --radius R (--corners X,Y,R for a sphere)";

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* steps: with a floor of up to the usual brightness where that is near to the least steps of 8 bits, as
 * 1/2000 of the bright parts is. */
static float *grey_of(const float *pix, int w, int h, int steps)
{
    size_t n = (size_t)w * (size_t)h, step = n / 20000 + 1, k = 0;
    float *g = malloc(n * sizeof *g), *some = malloc((n / step + 1) * sizeof *some);
    if (!g || !some) {
        free(g);
        free(some);
        return NULL;
    }
    for (size_t i = 0; i < n; i++) {
        const float *p = pix + 4 * i;
        float s = 0.265f * p[0] + 0.670f * p[1] + 0.065f * p[2];
        g[i] = p[3] >= 0.5f && s > 0 && s - s == 0 ? s : 0;
        if (i % step == 0 && g[i] > 0) some[k++] = g[i];
    }
    /* A floor at a tenth of the usual brightness keeps the noise of black surroundings quiet. */
    qsort(some, k, sizeof *some, by_value);
    float usual = k ? some[k / 2] : 1, bright = k ? some[k - 1 - k / 1000] : 1, floor_ = 0.1f * usual;
    if (steps) floor_ = fmaxf(floor_, fminf(usual, 0.0005f * bright));
    free(some);
    for (size_t i = 0; i < n; i++) g[i] = logf(g[i] + floor_);
    return g;
}

float *circle_grey(const float *pix, int w, int h)
{
    return grey_of(pix, w, h, 0);
}

static void mirror(float *g, int w, int h)
{
    for (int y = 0; y < h; y++)
        for (int i = 0, k = w - 1; i < k; i++, k--) {
            float *row = g + (size_t)y * (size_t)w, t = row[i];
            row[i] = row[k], row[k] = t;
        }
}

/* The same search of a mirrored copy, `scale` as large, blurred by sd (pixels of it; 0: not); o in pixels of
 * the picture. */
static int look_again(circle_look *o, const float *grey, int w, int h, double scale, double sd,
                      circle_kind kind, double radius, errmsg *e)
{
    int cw = (int)fmax(16, rint(w * scale)), ch = (int)fmax(16, rint(h * scale));
    double kx = (double)w / cw, ky = (double)h / ch;
    float *copy = malloc(sizeof(float) * (size_t)cw * (size_t)ch);
    if (!copy) return err_set(e, "out of memory");
    int failed = vision_reduce(copy, cw, ch, grey, w, h, e) || (sd > 0 && vision_soften(copy, cw, ch, sd, e));
    mirror(copy, cw, ch);
    failed = failed || circle_look_at(o, copy, cw, ch, kind, radius / kx, e);
    free(copy);
    o->f.x = w - o->f.x * kx, o->f.y *= ky, o->f.r *= (kx + ky) / 2;
    return failed ? -1 : 0;
}

static int more_looks(circle_look o[LOOKS], const float *grey, int w, int h, circle_kind kind, double radius,
                      errmsg *e)
{
    double longer = w > h ? w : h, r = o[0].f.r, scale = SMALLER * fmin(1, LARGE / longer),
           soft = fmin(1, 0.85 * LARGE / longer);
    if (scale * r < LEAST_R) scale = fmax(scale, fmin(LEAST_R / r, 0.85) * fmin(1, LARGE / longer));
    if (look_again(&o[1], grey, w, h, scale, 0, kind, radius, e)) return -1;
    return look_again(&o[2], grey, w, h, soft, fmin(4, fmax(0.8, soft * r / SOFT)), kind, radius, e);
}

/* How far two looks lie apart, share of the radius. */
static double between(const circle_look *a, const circle_look *b)
{
    if (!b->any) return 9;
    return fmin(9, fmax(hypot(b->f.x - a->f.x, b->f.y - a->f.y), fabs(b->f.r - a->f.r)) / a->f.r);
}

/* Why a circle is not believed that was looked at once; NULL if it is. */
static const char *doubt(const circle_look *o)
{
    if (o->f.strength < LEAST_STRENGTH * o->by_chance) return "too faint";
    if (o->f.margin < LEAST_MARGIN) return "others show as well";
    if (o->f.seen < LEAST_SEEN) return "too much of it outside of the picture";
    if (o->outside > MOST_OUTSIDE) return "something round around it";
    if (o->nested > MOST_NESTED) return "nothing but rings within it";
    if (o->within > MOST_WITHIN) return "another circle within it, about the same centre";
    return NULL;
}

/* What an edge may be off without any look telling, pixels: a quarter where it is clear all around.  Where it
 * isn't, a ball's outermost pixel, which holds half of the room, can pass for its rim. */
static double part_of_a_pixel(const circle_found *f)
{
    return fmin(0.8, 0.25 + 12 * (1 - f->share / f->seen));
}

/* The same after all looks; o[0].f.apart and .margin become what they all say. */
static const char *doubt_again(circle_look o[LOOKS])
{
    circle_found *f = &o[0].f;
    double soft = between(&o[0], &o[2]), sure = fmin(1, f->share / sqrt(f->seen) / SURE);
    double part = part_of_a_pixel(f) / f->r, most = AGREE * pow(sure, 4);
    f->apart = between(&o[0], &o[1]) + part;
    f->margin = (f->margin + o[1].f.margin + o[2].f.margin) / 3;
    if (f->apart > most)
        return f->apart - part > most / 2 ? "elsewhere in a smaller copy" : "too few pixels for its rim";
    if (soft > AGREE_SOFT) return "elsewhere in a softer copy";
    f->apart = fmax(f->apart, soft);
    return f->margin < LEAST_MARGIN ? "others show as well" : NULL;
}

int circle_find(circle_found *f, const float *pix, int w, int h, circle_kind kind, double radius, errmsg *e)
{
    circle_look o[LOOKS] = {0};
    const char *why = NULL;
    if (w < 16 || h < 16)
        return err_set(e, "expected a picture of at least 16 x 16 pixels to find a circle in, found %d x %d",
                       w, h);
    float *grey = grey_of(pix, w, h, 1);
    if (!grey) return err_set(e, "out of memory");
    int failed = circle_look_at(&o[0], grey, w, h, kind, radius, e);
    if (!failed && o[0].any) why = doubt(&o[0]);
    if (!failed && o[0].any && !why) failed = more_looks(o, grey, w, h, kind, radius, e);
    free(grey);
    if (failed) return -1;
    if (!o[0].any) return err_set(e, "expected a circle that stands out, found none; %s", by_hand);
    if (!why) why = doubt_again(o);
    *f = o[0].f;
    if (!why) return 0;
    return err_set(e,
                   "expected a circle that stands out, found at best one at %.1f,%.1f radius %.1f (%s; %.0f "
                   "%% of its rim seen, strength %.2f, margin %.2f); %s",
                   f->x, f->y, f->r, why, 100 * f->share, f->strength, f->margin, by_hand);
}
