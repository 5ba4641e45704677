/*
 * circlelook.c - search of one copy of a picture (circlelook.h).
 */
#include "circlelook.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ballrim.h"
#include "circleseed.h"
#include "rim.h"

#define SIDE     2048 /* pixels, longer side of the largest working copy */
#define SEEDS    120
#define SMALLEST 0.03 /* radius, share of the shorter side */
#define FEW      80   /* pixels of radius, on the finest copy: a small circle */
#define NEST     10   /* radii at which what lies within is looked at */

/* The level on which a circle (pixels of level `at`) has a radius of up to 180 pixels; c becomes pixels of
 * it. */
static int fitting_level(double c[3], int at, const rim_pyramid *p)
{
    for (; at > 0 && c[2] <= 90; at--)
        for (int k = 0; k < 3; k++) c[k] *= 2;
    for (; at + 1 < p->n && c[2] > 180; at++)
        for (int k = 0; k < 3; k++) c[k] /= 2;
    return at;
}

/* How sure an edge all around is a rim, 0..1: much of what is visible is an edge along the circle, and
 * nothing of the kind goes on outside of it (a reflection's circle inside of a ball has the rest of the ball
 * around it, squeezed into rings). */
static double strength(const rim_fit *t)
{
    return fmax(sqrt(t->share * fmax(t->along, 0)) - fmax(t->outside, 0), 0.001) * sqrt(t->seen);
}

/* What strength a rim can have by chance: short rims follow one edge or another more easily. */
static double by_chance(double r)
{
    return 1 + 0.6 * fmax(0, 1 - r / 50);
}

/* A circle that has been looked at. */
typedef struct judged {
    rim_fit fit;
    const rim_level *l;
    double worth; /* strength; of two circles that show equally well the larger is meant, a little */
} judged;

static int same_circle(const judged *a, const judged *b)
{
    double dx = fabs(a->fit.x * a->l->kx - b->fit.x * b->l->kx),
           dy = fabs(a->fit.y * a->l->ky - b->fit.y * b->l->ky);
    return fmax(fmax(dx, dy), fabs(a->fit.r * a->l->kx - b->fit.r * b->l->kx)) <= 0.05 * a->fit.r * a->l->kx;
}

/* The other circles beside the best. */
typedef struct choice {
    int any;
    judged best;
    double second; /* worth of the best other circle, 0: none */
    double within; /* strength of the best one in it, about nearly the same centre */
} choice;

static int is_within(const judged *a, const judged *b)
{
    double kx = a->l->kx / b->l->kx, ky = a->l->ky / b->l->ky, ratio = a->fit.r * kx / b->fit.r;
    return ratio > 0.3 && ratio < 0.94 &&
           hypot(a->fit.x * kx - b->fit.x, a->fit.y * ky - b->fit.y) < 0.08 * b->fit.r;
}

/* The best of the seeds (of->any: there is one). */
static void choose(choice *of, const circle_seed *s, int n, const rim_pyramid *p, circle_kind kind,
                   int free_radius)
{
    judged j[SEEDS];
    int found = 0, top = 0;
    *of = (choice){0};
    for (int i = 0; i < n; i++) {
        double c[3] = {s[i].c[0], s[i].c[1], s[i].c[2]};
        judged *q = &j[found];
        q->l = &p->level[fitting_level(c, s[i].at, p)];
        if (rim_trace(&q->fit, q->l, kind, free_radius, c, 0.05)) continue;
        q->worth = strength(&q->fit) / by_chance(q->fit.r) * pow(q->fit.r * q->l->kx, 0.12);
        if (q->worth > j[top].worth) top = found;
        found++;
    }
    if (!found) return;
    of->any = 1, of->best = j[top];
    for (int i = 0; i < found; i++) {
        if (!same_circle(&j[top], &j[i])) of->second = fmax(of->second, j[i].worth);
        if (is_within(&j[i], &j[top])) of->within = fmax(of->within, strength(&j[i].fit));
    }
}

/* Where the rim is, to a fraction of a pixel: its path on the finest level, where that agrees. */
static void polish(double c[3], double *rms, const rim_level *l, const rim_level *fine, circle_kind kind,
                   int free_radius)
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

/* A small circle's rim anew, c in pixels of the level: not in the logarithm but in the square root of the
 * brightness.  A blurred edge lies on its dark side in the logarithm, by half a pixel, which is much of a
 * small circle. */
static void polish_small(double c[3], const rim_level *l, circle_kind kind, errmsg *e)
{
    int x0 = (int)fmax(0, c[0] - 1.5 * c[2] - 4), y0 = (int)fmax(0, c[1] - 1.5 * c[2] - 4);
    int w = (int)fmin(l->w, c[0] + 1.5 * c[2] + 4) - x0, h = (int)fmin(l->h, c[1] + 1.5 * c[2] + 4) - y0;
    double mean = 0, t[3] = {c[0] - x0, c[1] - y0, c[2]};
    rim_pyramid p;
    rim_fit f;
    float *part = w < 16 || h < 16 ? NULL : malloc(sizeof *part * (size_t)w * (size_t)h);
    if (!part) return;
    for (int k = 0; k < w * h; k++)
        mean += (double)(part[k] = l->g[(size_t)(y0 + k / w) * (size_t)l->w + (size_t)(x0 + k % w)]);
    mean /= (double)w * h;
    for (int k = 0; k < w * h; k++) part[k] = 2 * fminf(expf((part[k] - (float)mean) / 2), 4);
    int failed = rim_pyramid_new(&p, part, w, h, SIDE, e);
    free(part);
    if (failed) return;
    if (!rim_trace(&f, &p.level[0], kind, 1, t, fmax(0.03, 1.2 / t[2])) && f.share > 0.6 &&
        hypot(f.x - t[0], f.y - t[1]) < 1.5 && fabs(f.r - t[2]) < 1.5)
        c[0] = f.x + x0, c[1] = f.y + y0, c[2] = f.r;
    rim_pyramid_free(&p);
}

/* A ball's rim is the outermost circle near the one found.  A clean one says itself where it is: its edges
 * agree.  Where they don't, as they are reflections' edges in part, or the ball is an oval by perspective, it
 * is the votes that count, and who cuts a ball out keeps it whole: then the frame bounds it. */
static void settle(circle_found *f, const judged *best, const rim_level *fine, int w, int h, circle_kind kind,
                   int free_radius)
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
    double mean = (fine->kx + fine->ky) / 2, t[3] = {c[0] / fine->kx, c[1] / fine->ky, c[2] / mean};
    if (free_radius && t[2] < FEW) {
        errmsg e;
        polish_small(t, fine, kind, &e);
        c[0] = t[0] * fine->kx, c[1] = t[1] * fine->ky, c[2] = t[2] * mean;
    }
    f->x = c[0], f->y = c[1], f->r = c[2], f->rms = rms;
}

/* How much of what lies within is rings about the same centre, mean t from 0.72 to 0.92 of the radius: a
 * third of a ball's picture at most, which the rim squeezes; a flange, a plate or a wheel is nothing else. */
static double nested(const rim_fit *t, const rim_level *l, circle_kind kind)
{
    double sum = 0;
    for (int k = 0; k < NEST; k++)
        sum += rim_score(l, kind, t->x, t->y, t->r * (0.72 + 0.2 * (k + 0.5) / NEST));
    return sum / NEST;
}

int circle_look_at(circle_look *o, const float *grey, int w, int h, circle_kind kind, double radius,
                   errmsg *e)
{
    rim_pyramid p;
    circle_seed s[SEEDS];
    choice of = {0};
    int free_radius = radius <= 0;
    *o = (circle_look){0};
    if (rim_pyramid_new(&p, grey, w, h, SIDE, e)) return -1;
    double shorter = fmin(p.level[0].w, p.level[0].h),
           r0 = free_radius ? fmax(SMALLEST * shorter, 4) : radius / p.level[0].kx;
    int n = circle_seeds(s, SEEDS, &p, kind, r0, free_radius ? fmax(p.level[0].w, p.level[0].h) : r0, e);
    if (n > 0) choose(&of, s, n, &p, kind, free_radius);
    if (of.any) {
        const rim_fit *t = &of.best.fit;
        o->any = 1, o->by_chance = by_chance(t->r), o->outside = t->outside,
        o->nested = nested(t, of.best.l, kind);
        o->within = of.within / fmax(strength(t), 0.01);
        o->f.seen = t->seen, o->f.share = t->share * t->seen, o->f.contrast = t->contrast;
        o->f.strength = strength(t), o->f.margin = 1 - of.second / of.best.worth;
        settle(&o->f, &of.best, &p.level[0], w, h, kind, free_radius);
    }
    rim_pyramid_free(&p);
    return n < 0 ? -1 : 0;
}
