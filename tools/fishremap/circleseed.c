/*
 * circleseed.c - where circles may be (circleseed.h).
 */
#include "circleseed.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "vision/circles.h"

#define KEPT 40 /* of every circle on the smallest copy */
#define VOTED                                                                                                \
    50 /* of the votes, for each of the BANDS of radii: small circles are many, and must not be crowded out  \
          by large ones */
#define BANDS   3
#define LISTS   (BANDS + 3)
#define HOUGH   24    /* of OpenCV's */
#define MIDDLES 8     /* circles about the picture's middle */
#define EDGE    0.02f /* log units per pixel: below, a gradient is noise */
#define MIDDLE  640   /* pixels, longer side of the level that the edges vote on */
#define HOUGH_SIDE                                                                                           \
    320 /* of the one that OpenCV sees: its time grows with the area and the longest radius; small circles   \
           are voted for */
#define PAD 0.35 /* of the radius: how far outside of the picture a centre may lie */

typedef struct seedlist {
    circle_seed *s;
    int n, room;
} seedlist;

/* Keep the best; what is nearly the same (closer than `apart` pixels) counts once. */
static void keep(seedlist *l, const circle_seed *c, double apart)
{
    int worst = 0;
    for (int k = 0; k < l->n; k++) {
        const circle_seed *o = &l->s[k];
        if (o->placed == c->placed &&
            fabs(o->c[0] - c->c[0]) + fabs(o->c[1] - c->c[1]) + fabs(o->c[2] - c->c[2]) < apart) {
            if (c->score > o->score) l->s[k] = *c;
            return;
        }
        if (o->score < l->s[worst].score) worst = k;
    }
    if (l->n < l->room) l->s[l->n++] = *c;
    else if (c->score > l->s[worst].score) l->s[worst] = *c;
}

/* Every circle on the smallest copy. */
static void all_circles(seedlist *out, const rim_pyramid *p, circle_kind kind, double r0, double r1)
{
    int at = p->n - 1;
    const rim_level *l = &p->level[at];
    double k = l->kx / p->level[0].kx;
    for (double r = fmax(r0 / k, 0.12 * fmin(l->w, l->h)); r <= r1 / k + 0.5; r *= 1 + fmin(0.1, 1 / r))
        for (double y = -PAD * r; y <= l->h + PAD * r; y += 1)
            for (double x = -PAD * r; x <= l->w + PAD * r; x += 1) {
                double s = rim_score(l, kind, x, y, r) * pow(r / (l->w + l->h), 0.25);
                if (s > 0.02) keep(out, &(circle_seed){{x, y, r}, at, s, 0}, 3);
            }
}

/* Who cuts a picture to the ball, or fills the frame with the image circle, puts it in the middle. */
static void middle_circles(seedlist *out, const rim_level *l, int at, circle_kind kind, double r1)
{
    for (double r = 0.5 * fmin(l->w, l->h), f = 1; f > 0.85 && r <= r1; f -= 0.03)
        keep(out,
             &(circle_seed){
                 {0.5 * l->w, 0.5 * l->h, f * r}, at, rim_score(l, kind, 0.5 * l->w, 0.5 * l->h, f * r), 1},
             1);
}

typedef struct edge {
    float x, y, nx, ny, weight;
} edge;

/* Edges a pixel wide: where the gradient is largest along its own direction.  malloc'd. */
static edge *edges(int *count, const rim_level *l)
{
    edge *out = malloc(sizeof *out * (size_t)l->w * (size_t)l->h);
    int n = 0;
    for (int y = 1; out && y + 1 < l->h; y++)
        for (int x = 1; x + 1 < l->w; x++) {
            size_t at = (size_t)y * (size_t)l->w + (size_t)x;
            float gx = l->gx[at], gy = l->gy[at], m = hypotf(gx, gy);
            if (m < EDGE) continue;
            ptrdiff_t dx = lrintf(gx / m), dy = lrintf(gy / m), step = dy * l->w + dx;
            size_t a = (size_t)((ptrdiff_t)at + step), b = (size_t)((ptrdiff_t)at - step);
            if (m < hypotf(l->gx[a], l->gy[a]) || m < hypotf(l->gx[b], l->gy[b])) continue;
            out[n++] = (edge){(float)x + 0.5f, (float)y + 0.5f, gx / m, gy / m, m / (m + 2 * EDGE)};
        }
    *count = n;
    return out;
}

/* One radius: votes for centres in cells of a twentieth of it, the share of the circumference that votes. */
static int votes_for(seedlist *out, const edge *e, int n, const rim_level *l, int at, circle_kind kind,
                     double r)
{
    double cell = fmax(1, 0.05 * r), pad = PAD * r;
    int aw = (int)((l->w + 2 * pad) / cell) + 3, ah = (int)((l->h + 2 * pad) / cell) + 3;
    float *a = calloc((size_t)aw * (size_t)ah, sizeof *a);
    if (!a) return -1;
    for (int k = 0; k < n; k++)
        for (int side = kind == CIRCLE_LENS ? 1 : -1; side <= 1; side += 2) {
            int i = (int)((e[k].x + side * r * e[k].nx + pad) / cell + 1),
                j = (int)((e[k].y + side * r * e[k].ny + pad) / cell + 1);
            if (i >= 0 && j >= 0 && i < aw && j < ah) a[j * aw + i] += e[k].weight;
        }
    for (int j = 1; j + 1 < ah; j++)
        for (int i = 1; i + 1 < aw; i++) {
            const float *c = a + j * aw + i;
            int top = 1;
            float sum = 0;
            for (int q = 0; q < 9; q++) {
                float v = c[(q / 3 - 1) * aw + q % 3 - 1];
                sum += v, top &= v <= *c;
            }
            double share = (double)sum / (2 * M_PI * r);
            if (!top || share < 0.2) continue;
            circle_seed s = {{(i - 0.5) * cell - pad, (j - 0.5) * cell - pad, r},
                             at,
                             share * pow(r / (l->w + l->h), 0.25),
                             0};
            keep(out, &s, 0.1 * r);
        }
    free(a);
    return 0;
}

/* out: BANDS lists, by radius: below a twelfth of the shorter side, below a quarter, the rest. */
static int voted(seedlist out[BANDS], const rim_level *l, int at, circle_kind kind, double r0, double r1)
{
    int n, rc = 0;
    double shorter = fmin(l->w, l->h);
    edge *e = edges(&n, l);
    for (double r = r0; !rc && e && r <= 1.04 * r1; r *= 1.07)
        rc = votes_for(&out[r < shorter / 12 ? 0 : r < shorter / 4 ? 1 : 2], e, n, l, at, kind, r);
    free(e);
    return e && !rc ? 0 : -1;
}

static int hough(seedlist *out, const rim_level *l, int at, circle_kind kind, double r0, double r1, errmsg *e)
{
    vision_circle c[HOUGH];
    int n = vision_circles(c, HOUGH, l->g, l->w, l->h, fmax(r0, 4), r1, e);
    for (int k = 0; k < n; k++)
        keep(out, &(circle_seed){{c[k].x, c[k].y, c[k].r}, at, rim_score(l, kind, c[k].x, c[k].y, c[k].r), 0},
             2);
    return n < 0 ? -1 : 0;
}

/* To level `to`, or as near as what is there allows. */
static void on_level(circle_seed *s, int to)
{
    for (; s->at < to; s->at++)
        for (int k = 0; k < 3; k++) s->c[k] /= 2;
    for (; s->at > to; s->at--)
        for (int k = 0; k < 3; k++) s->c[k] *= 2;
}

/* Uphill on the level where the circle is about 20 pixels in radius, so that a pixel is a wide step. */
static void climb_far(circle_seed *s, const rim_pyramid *p, circle_kind kind, int free_radius, int mid)
{
    int at = s->at;
    double r = s->c[2];
    for (; at + 1 < p->n && r > 30; r /= 2) at++;
    for (; at > mid && r < 12; r *= 2) at--;
    on_level(s, at);
    s->score = rim_climb(s->c, &p->level[at], kind, free_radius, 1);
}

/* And on finer ones, up to level `to`. */
static void climb_near(circle_seed *s, const rim_pyramid *p, circle_kind kind, int free_radius, int to)
{
    while (s->at > to) {
        on_level(s, s->at - 1);
        s->score = rim_climb(s->c, &p->level[s->at], kind, free_radius, 1);
    }
}

static int by_score(const void *a, const void *b)
{
    double x = ((const circle_seed *)a)->score, y = ((const circle_seed *)b)->score;
    return (x < y) - (x > y);
}

int circle_seeds(circle_seed *s, int room, const rim_pyramid *p, circle_kind kind, double r0, double r1,
                 errmsg *e)
{
    circle_seed all[KEPT], by_votes[BANDS][VOTED], by_hough[HOUGH], middle[MIDDLES];
    seedlist list[LISTS] = {{by_votes[0], 0, VOTED}, {by_votes[1], 0, VOTED}, {by_votes[2], 0, VOTED},
                            {all, 0, KEPT},          {by_hough, 0, HOUGH},    {middle, 0, MIDDLES}},
             out = {s, 0, room};
    int free_radius = r1 > 1.01 * r0, mid = 0;
    while (mid + 1 < p->n && (p->level[mid].w > MIDDLE || p->level[mid].h > MIDDLE)) mid++;
    const rim_level *l = &p->level[mid];
    double k = l->kx / p->level[0].kx;
    all_circles(&list[BANDS], p, kind, r0, r1);
    if (voted(list, l, mid, kind, r0 / k, r1 / k)) return err_set(e, "out of memory");
    if (free_radius) middle_circles(&list[LISTS - 1], l, mid, kind, r1 / k);
    int low = mid;
    while (low + 1 < p->n && fmax(p->level[low].w, p->level[low].h) > HOUGH_SIDE) low++;
    const rim_level *small = &p->level[low];
    double ks = small->kx / p->level[0].kx;
    if (free_radius &&
        hough(&list[BANDS + 1], small, low, kind, r0 / ks, fmin(r1 / ks, 0.6 * fmax(small->w, small->h)), e))
        return -1;
    for (int i = 0; i < LISTS; i++)
        for (int q = 0; q < list[i].n; q++) {
            circle_seed c = list[i].s[q];
            if (!c.placed) climb_far(&c, p, kind, free_radius, mid);
            /* alike on a coarse level: one is enough */
            circle_seed fine = c;
            on_level(&fine, mid);
            if ((c.score > 0.1 || c.placed) && fine.c[2] >= 0.8 * r0 / k)
                keep(&out, &fine, fmax(2, 0.025 * fine.c[2]));
        }
    for (int i = 0; i < out.n; i++) {
        int at = mid;
        for (double r = s[i].c[2]; !s[i].placed && at + 1 < p->n && r > 30; r /= 2) at++;
        on_level(&s[i], at);
        if (s[i].placed) s[i].score = rim_climb(s[i].c, l, kind, free_radius, 1);
        else climb_near(&s[i], p, kind, free_radius, mid);
    }
    qsort(s, (size_t)out.n, sizeof *s, by_score);
    return out.n;
}
