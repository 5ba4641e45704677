/*
 * circle.c - search of a circle in a picture (circle.h).
 */
#include "circle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ballrim.h"
#include "circleseed.h"
#include "rim.h"

#define SIDE 2048   /* pixels, longer side of the largest working copy */
#define SEEDS 120
#define SMALLEST 0.03     /* radius, share of the shorter side */
/* What is not refused; measured on photographs with bench/circles/evaluate.py */
#define MOST_OUTSIDE 0.22 /* rings around it: it lies inside of something round */
#define LEAST_SEEN 0.4    /* of the circumference in the picture */
#define LEAST_SHARE 0.66  /* of what is in the picture: where an edge follows the circle; less leaves its place loose */
#define LEAST_MARGIN 0.14 /* over another circle */


static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

float *circle_grey(const float *pix, int w, int h)
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
    /* a floor at a tenth of the usual brightness keeps the noise of black surroundings quiet */
    qsort(some, k, sizeof *some, by_value);
    float floor_ = k ? 0.1f * some[k / 2] : 1;
    free(some);
    for (size_t i = 0; i < n; i++) g[i] = logf(g[i] + floor_);
    return g;
}


/* The level on which a circle (pixels of level `at`) has a radius of up to 180 pixels; c becomes pixels of it. */
static int fitting_level(double c[3], int at, const rim_pyramid *p)
{
    for (; at > 0 && c[2] <= 90; at--)
        for (int k = 0; k < 3; k++) c[k] *= 2;
    for (; at + 1 < p->n && c[2] > 180; at++)
        for (int k = 0; k < 3; k++) c[k] /= 2;
    return at;
}

/* How sure an edge all around is a rim, 0..1: much of what is visible is an edge along the circle, and nothing of the kind goes on
 * outside of it (a reflection's circle inside of a ball has the rest of the ball around it, squeezed into rings). */
static double strength(const rim_fit *t)
{
    return fmax(sqrt(t->share * fmax(t->along, 0)) - fmax(t->outside, 0), 0.001) * sqrt(t->seen);
}

/* A circle that has been looked at. */
typedef struct judged {
    rim_fit fit;
    const rim_level *l;
    double worth; /* strength; of two circles that show equally well the larger is meant, a little */
} judged;

static int same_circle(const judged *a, const judged *b)
{
    double dx = fabs(a->fit.x * a->l->kx - b->fit.x * b->l->kx), dy = fabs(a->fit.y * a->l->ky - b->fit.y * b->l->ky);
    return fmax(fmax(dx, dy), fabs(a->fit.r * a->l->kx - b->fit.r * b->l->kx)) <= 0.05 * a->fit.r * a->l->kx;
}

/* The best of the seeds and, of those that are other circles, the worth of the second best (0: none).  1 if there is any. */
static int choose(judged *best, double *second, const circle_seed *s, int n, const rim_pyramid *p, circle_kind kind, int free_radius)
{
    judged j[SEEDS];
    int found = 0, top = 0;
    for (int i = 0; i < n; i++) {
        double c[3] = {s[i].c[0], s[i].c[1], s[i].c[2]};
        judged *q = &j[found];
        q->l = &p->level[fitting_level(c, s[i].at, p)];
        if (rim_trace(&q->fit, q->l, kind, free_radius, c, 0.05)) continue;
        q->worth = strength(&q->fit) * pow(q->fit.r * q->l->kx, 0.25);
        if (q->worth > j[top].worth) top = found;
        found++;
    }
    *second = 0;
    for (int i = 0; i < found; i++)
        if (!same_circle(&j[top], &j[i])) *second = fmax(*second, j[i].worth);
    if (found) *best = j[top];
    return found > 0;
}

/* Where the rim is, to a fraction of a pixel: its path on the finest level, where that agrees. */
static void polish(double c[3], double *rms, const rim_level *l, const rim_level *fine, circle_kind kind, int free_radius)
{
    double k = l->kx / fine->kx, t[3] = {k * c[0], k * c[1], k * c[2]};
    rim_fit f;
    *rms *= c[2] * l->kx;
    if (rim_trace(&f, fine, kind, free_radius, t, fmax(0.01, 2.5 / t[2])) || f.share < 0.5) f.r = 0;
    if (f.r > 0 && hypot(f.x - t[0], f.y - t[1]) < 0.012 * t[2] && fabs(f.r - t[2]) < 0.012 * t[2]) {
        t[0] = f.x, t[1] = f.y, t[2] = f.r;
        *rms = f.rms * f.r * fine->kx;
    }
    c[0] = t[0] * fine->kx, c[1] = t[1] * fine->ky, c[2] = t[2] * (fine->kx + fine->ky) / 2;
}

/* A ball's rim is the outermost circle near the one found.  A clean one says itself where it is: its edges agree.  Where they don't,
 * as they are reflections' edges in part, or the ball is an oval by perspective, it is the votes that count, and who cuts a ball
 * out keeps it whole: then the frame bounds it. */
static void settle(circle_found *f, const judged *best, const rim_level *fine, int w, int h, circle_kind kind, int free_radius)
{
    double c[3] = {best->fit.x, best->fit.y, best->fit.r}, rms = best->fit.rms;
    int clean = 1;
    if (kind == CIRCLE_BALL && free_radius) {
        rim_fit own;
        ball_rim(c, best->l);
        int traced = !rim_trace(&own, best->l, kind, 1, c, 0.02);
        /* a shadow or a table's edge can outvote the rim: then its path there is the worse one */
        if (!traced || strength(&own) < strength(&best->fit) - 0.02) {
            own = best->fit;
            c[0] = own.x, c[1] = own.y, c[2] = own.r;
        }
        clean = own.share > 0.75 && own.rms < 0.0045;
        if (clean) c[0] = own.x, c[1] = own.y, c[2] = own.r, rms = own.rms;
    }
    if (clean) {
        polish(c, &rms, best->l, fine, kind, free_radius);
    } else {
        rms *= c[2] * best->l->kx;
        c[0] *= best->l->kx, c[1] *= best->l->ky, c[2] *= best->l->kx;
        ball_cut_out(c, w, h);
    }
    f->x = c[0], f->y = c[1], f->r = c[2], f->rms = rms;
}

/* The least strength of a rim that is believed.  Small circles are many, and some look like rims by chance. */
static double least(const rim_fit *t)
{
    return 0.58 + 0.34 * fmax(0, 1 - t->r / 50);
}

int circle_find(circle_found *f, const float *pix, int w, int h, circle_kind kind, double radius, errmsg *e)
{
    rim_pyramid p;
    circle_seed s[SEEDS];
    judged best = {0};
    double second = 0;
    int free_radius = radius <= 0, n = -1, any = 0;
    if (w < 16 || h < 16) return err_set(e, "expected a picture of at least 16 x 16 pixels to find a circle in, found %d x %d", w, h);
    float *grey = circle_grey(pix, w, h);
    if (!grey) return err_set(e, "out of memory");
    int failed = rim_pyramid_new(&p, grey, w, h, SIDE, e);
    free(grey);
    if (failed) return -1;
    double shorter = fmin(p.level[0].w, p.level[0].h), r0 = free_radius ? fmax(SMALLEST * shorter, 4) : radius / p.level[0].kx;
    n = circle_seeds(s, SEEDS, &p, kind, r0, free_radius ? fmax(p.level[0].w, p.level[0].h) : r0, e);
    if (n > 0) any = choose(&best, &second, s, n, &p, kind, free_radius);
    if (any) {
        const rim_fit *t = &best.fit;
        f->seen = t->seen, f->share = t->share * t->seen, f->contrast = t->contrast;
        f->strength = strength(t), f->margin = 1 - second / best.worth;
        settle(f, &best, &p.level[0], w, h, kind, free_radius);
    }
    rim_pyramid_free(&p);
    if (n < 0) return -1;
    if (!any) return err_set(e, "expected a circle that stands out, found none; say where it is: --centre X,Y --radius R (--corners X,Y,R for a sphere)");
    if (f->strength >= least(&best.fit) && best.fit.outside < MOST_OUTSIDE && best.fit.seen > LEAST_SEEN && best.fit.share > LEAST_SHARE && f->margin > LEAST_MARGIN) return 0;
    return err_set(e, "expected a circle that stands out, found at best one at %.1f,%.1f radius %.1f (%.0f %% of its rim seen, strength %.2f, margin %.2f over the next); "
                      "say where it is: --centre X,Y --radius R (--corners X,Y,R for a sphere)", f->x, f->y, f->r, 100 * f->share, f->strength, f->margin);
}
