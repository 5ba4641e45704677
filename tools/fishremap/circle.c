/*
 * circle.c - search and fit of a circle in a picture (circle.h).
 */
#include "circle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define COARSE 64   /* pixels, longer side of the smallest copy */
#define ANGLES 96
#define KEPT 40     /* candidates that are followed up */
#define FAINT 0.03f /* log units per pixel: gradients well above count in full */

typedef struct level {
    int w, h;
    float *g;         /* grey */
    float *gx, *gy;   /* its gradient */
    double scale;     /* pixels of the picture per pixel here */
} level;

typedef struct candidate {
    double x, y, r, score;
} candidate;

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

static void level_free(level *l)
{
    free(l->g);
    free(l->gx);
    free(l->gy);
}

/* Central differences of a slightly smoothed copy. */
static int gradients(level *l)
{
    int w = l->w, h = l->h;
    l->gx = calloc((size_t)w * (size_t)h, sizeof(float));
    l->gy = calloc((size_t)w * (size_t)h, sizeof(float));
    if (!l->gx || !l->gy) return -1;
    for (int y = 1; y + 1 < h; y++)
        for (int x = 1; x + 1 < w; x++) {
            const float *p = l->g + (size_t)y * (size_t)w + (size_t)x;
            float l1 = p[-w - 1] + 2 * p[-1] + p[w - 1], r1 = p[-w + 1] + 2 * p[1] + p[w + 1];
            float u1 = p[-w - 1] + 2 * p[-w] + p[-w + 1], d1 = p[w - 1] + 2 * p[w] + p[w + 1];
            l->gx[(size_t)y * (size_t)w + (size_t)x] = (r1 - l1) / 8;
            l->gy[(size_t)y * (size_t)w + (size_t)x] = (d1 - u1) / 8;
        }
    return 0;
}

/* Copy reduced by an integer factor, box-filtered. */
static int reduce(level *out, const float *g, int w, int h, int k)
{
    memset(out, 0, sizeof *out);
    out->w = w / k, out->h = h / k, out->scale = k;
    if (out->w < 3 || out->h < 3) return -1;
    out->g = malloc(sizeof(float) * (size_t)out->w * (size_t)out->h);
    if (!out->g) return -1;
    for (int y = 0; y < out->h; y++)
        for (int x = 0; x < out->w; x++) {
            float s = 0;
            for (int j = 0; j < k; j++)
                for (int i = 0; i < k; i++) s += g[(size_t)(y * k + j) * (size_t)w + (size_t)(x * k + i)];
            out->g[(size_t)y * (size_t)out->w + (size_t)x] = s / (float)(k * k);
        }
    return gradients(out);
}

static double cosines[ANGLES], sines[ANGLES];

/* How radial the gradient is along the circle, -1..1 per sample and 0 on average in a random
 * picture, times how much of the circle is in the picture. */
static double score(const level *l, circle_kind kind, double x, double y, double r)
{
    float sum = 0;
    int seen = 0;
    for (int k = 0; k < ANGLES; k++) {
        double px = x + r * cosines[k], py = y + r * sines[k];
        int i = (int)floor(px), j = (int)floor(py);
        if (i < 1 || j < 1 || i >= l->w - 1 || j >= l->h - 1) continue;
        size_t at = (size_t)j * (size_t)l->w + (size_t)i;
        float gx = l->gx[at], gy = l->gy[at];
        float d = gx * (float)cosines[k] + gy * (float)sines[k], all = gx * gx + gy * gy;
        float t = (2 * d * d - all) / (all + FAINT * FAINT);
        seen++;
        sum += kind == CIRCLE_LENS && d > 0 ? -fabsf(t) : t;
    }
    if (seen < ANGLES / 8) return 0;
    return (double)sum / seen * sqrt((double)seen / ANGLES) * sqrt(sqrt(r / (l->w + l->h)));
}

static void keep(candidate *best, const candidate *c)
{
    int worst = 0;
    for (int k = 0; k < KEPT; k++) {
        double apart = fabs(best[k].x - c->x) + fabs(best[k].y - c->y) + fabs(best[k].r - c->r);
        if (best[k].score > 0 && apart < 3) { /* the same again */
            if (c->score > best[k].score) best[k] = *c;
            return;
        }
        if (best[k].score < best[worst].score) worst = k;
    }
    if (c->score > best[worst].score) best[worst] = *c;
}

static void climb(candidate *c, const level *l, circle_kind kind, int free_radius)
{
    c->score = score(l, kind, c->x, c->y, c->r);
    for (double step = 2; step > 0.2; step /= 2)
        for (int moved = 1, it = 0; moved && it < 30; it++) {
            moved = 0;
            for (int m = 0; m < 27; m++) {
                candidate t = *c;
                t.x += step * (m % 3 - 1), t.y += step * (m / 3 % 3 - 1), t.r += free_radius ? step * (m / 9 - 1) : 0;
                t.score = score(l, kind, t.x, t.y, t.r);
                if (t.score > c->score) *c = t, moved = 1;
            }
        }
}

static float bilinear(const float *g, int w, int h, double x, double y)
{
    x -= 0.5, y -= 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    if (i < 0 || j < 0 || i + 1 >= w || j + 1 >= h) return NAN;
    float u = (float)(x - i), v = (float)(y - j);
    const float *p = g + (size_t)j * (size_t)w + (size_t)i;
    return (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[w] + u * p[w + 1]);
}

/* Rim along one radius: where the change over 2 px is strongest within the slack, to a fraction of a pixel. */
static int rim_at(double *rim, float *strength, const float *grey, int w, int h, circle_kind kind, const circle_found *f, double c,
                  double s, double slack)
{
    enum { STEPS = 4 }; /* per pixel */
    int n = (int)(slack * STEPS);
    float best = 0, before = 0, after = 0, last = NAN;
    double at = 0;
    int take_next = 0;
    for (int k = -n; k <= n; k++) {
        double r = f->r + (double)k / STEPS;
        float a = bilinear(grey, w, h, f->x + (r - 1) * c, f->y + (r - 1) * s);
        float b = bilinear(grey, w, h, f->x + (r + 1) * c, f->y + (r + 1) * s), d = a - b;
        if (isnan(d)) {
            last = NAN, take_next = 0;
            continue;
        }
        if (kind == CIRCLE_BALL) d = fabsf(d);
        if (take_next) after = d, take_next = 0;
        if (d > best && !isnan(last)) best = d, at = r, before = last, after = d, take_next = 1;
        last = d;
    }
    if (best < 0.08f || take_next) return 0;
    float den = before - 2 * best + after;
    *rim = at + (den < 0 ? 0.5 * (double)((before - after) / den) / STEPS : 0);
    *strength = best;
    return 1;
}

/* Weighted algebraic circle fit (Kasa), good enough inside a reweighted loop near the answer. */
static int fit(circle_found *f, const double *px, const double *py, const double *wt, int n)
{
    double s[9] = {0}, mx = 0, my = 0, sw = 0;
    for (int i = 0; i < n; i++) mx += wt[i] * px[i], my += wt[i] * py[i], sw += wt[i];
    if (!(sw > 0)) return -1;
    mx /= sw, my /= sw;
    for (int i = 0; i < n; i++) {
        double u = px[i] - mx, v = py[i] - my, q = u * u + v * v;
        s[0] += wt[i] * u * u, s[1] += wt[i] * u * v, s[2] += wt[i] * v * v;
        s[3] += wt[i] * u * q, s[4] += wt[i] * v * q, s[5] += wt[i] * q;
    }
    double det = s[0] * s[2] - s[1] * s[1];
    if (!(det > 1e-9 * s[0] * s[2])) return -1;
    double a = (s[3] * s[2] - s[4] * s[1]) / (2 * det), b = (s[4] * s[0] - s[3] * s[1]) / (2 * det);
    f->x = mx + a, f->y = my + b, f->r = sqrt(s[5] / sw + a * a + b * b);
    return 0;
}

int circle_refine(circle_found *f, const float *grey, int w, int h, circle_kind kind, double slack)
{
    enum { RAYS = 360 };
    double px[RAYS], py[RAYS], wt[RAYS];
    circle_found c = *f;
    int n = 0;
    for (int pass = 0; pass < 4; pass++) {
        double reach = pass == 0 ? slack : fmax(slack / (1 << pass), 2);
        n = 0;
        for (int k = 0; k < RAYS; k++) {
            double co = cos(2 * M_PI * k / RAYS), si = sin(2 * M_PI * k / RAYS), r;
            float strength;
            if (!rim_at(&r, &strength, grey, w, h, kind, &c, co, si, reach)) continue;
            px[n] = c.x + r * co, py[n] = c.y + r * si, wt[n++] = fminf(strength, 1);
        }
        if (n < RAYS / 10) return -1;
        double base[RAYS];
        memcpy(base, wt, sizeof base);
        for (int it = 0; it < 20; it++) {
            circle_found t = c;
            if (fit(&t, px, py, wt, n)) return -1;
            c = t;
            float dev[RAYS];
            for (int i = 0; i < n; i++) dev[i] = (float)fabs(hypot(px[i] - c.x, py[i] - c.y) - c.r);
            float sorted[RAYS];
            memcpy(sorted, dev, sizeof(float) * (size_t)n);
            qsort(sorted, (size_t)n, sizeof(float), by_value);
            double scale = fmax(4.685 * 1.4826 * (double)sorted[n / 2], 0.3);
            for (int i = 0; i < n; i++) {
                double u = (double)dev[i] / scale;
                wt[i] = u < 1 ? base[i] * (1 - u * u) * (1 - u * u) : 0;
            }
        }
        if (!(fabs(c.x - f->x) + fabs(c.y - f->y) < 3 * slack + 1) || !(fabs(c.r - f->r) < 2 * slack + 1)) return -1;
    }
    double sq = 0;
    int agree = 0;
    for (int i = 0; i < n; i++)
        if (wt[i] > 0) {
            double d = hypot(px[i] - c.x, py[i] - c.y) - c.r;
            sq += d * d, agree++;
        }
    c.share = (double)agree / RAYS;
    c.rms = agree ? sqrt(sq / agree) : 0;
    *f = c;
    return agree < RAYS / 10 ? -1 : 0;
}

/* Candidates, in pixels of the picture, score 0 where there are fewer; -1 if none stands out. */
static int search(candidate found[KEPT], const float *grey, int w, int h, circle_kind kind, double radius)
{
    int longer = w > h ? w : h, k = longer / COARSE > 1 ? longer / COARSE : 1, rc = -1;
    level l;
    candidate best[KEPT];
    memset(best, 0, sizeof best);
    for (int i = 0; i < ANGLES; i++) cosines[i] = cos(2 * M_PI * i / ANGLES), sines[i] = sin(2 * M_PI * i / ANGLES);
    if (reduce(&l, grey, w, h, k)) goto done;
    double shorter = l.w < l.h ? l.w : l.h, r0 = radius > 0 ? radius / k : 0.15 * shorter;
    double r1 = radius > 0 ? radius / k + 0.5 : 1.0 * (l.w > l.h ? l.w : l.h);
    for (double r = r0; r <= r1; r += 1)
        for (double y = -0.3 * l.h; y <= 1.3 * l.h; y += 1)
            for (double x = -0.3 * l.w; x <= 1.3 * l.w; x += 1) {
                candidate t = {x, y, r, score(&l, kind, x, y, r)};
                if (t.score > best[0].score * 0.5) keep(best, &t);
            }
    for (;;) {
        for (int i = 0; i < KEPT; i++)
            if (best[i].score > 0) climb(&best[i], &l, kind, radius <= 0);
        if (k == 1 || l.w >= 600) break;
        int next = k / 2;
        double ratio = (double)k / next;
        level_free(&l);
        if (reduce(&l, grey, w, h, next)) goto done;
        k = next;
        for (int i = 0; i < KEPT; i++) best[i].x *= ratio, best[i].y *= ratio, best[i].r *= ratio;
    }
    for (int i = 0; i < KEPT; i++) {
        found[i] = best[i];
        found[i].x *= k, found[i].y *= k, found[i].r *= k;
        if (best[i].score > 0.05) rc = 0;
    }
done:
    level_free(&l);
    return rc;
}

/* How well a ball's rim shows at a circle: the mean over the rays of how much more the picture changes across it than beyond it (log
 * ratio, at most 2 either way), times the radius, as of two rims the outer one holds the inner as a reflection, and less
 * the more of it is outside the picture: there it says nothing.  b: half the width, in pixels, over which a change is seen; what
 * is beyond begins where the edge's own blur has ended. */
static double rim_votes(const float *grey, int w, int h, const circle_found *f, double b)
{
    double from[4] = {-b, b, fmax(1.5 * b, 2.5), 0}, sum = 0;
    int seen = 0;
    from[3] = from[2] + 3 * b;
    for (int k = 0; k < ANGLES; k++) {
        float v[4];
        for (int i = 0; i < 4; i++)
            v[i] = bilinear(grey, w, h, f->x + (f->r + from[i]) * cosines[k], f->y + (f->r + from[i]) * sines[k]);
        if (isnan(v[0]) || isnan(v[3])) continue;
        sum += fmax(-2, fmin(2, log(((double)fabsf(v[1] - v[0]) + 0.02) / ((double)fabsf(v[3] - v[2]) / 1.5 + 0.02))));
        seen++;
    }
    return seen < ANGLES / 4 ? 0 : sum / seen * f->r * sqrt((double)seen / ANGLES);
}

/* Uphill in the votes, which are seen ever finer. */
static void climb_votes(circle_found *f, const float *grey, int w, int h)
{
    double b = fmax(f->r / 65, 1);
    for (int last = 0; !last; b = fmax(b / M_SQRT2, 1)) {
        last = b == 1;
        double best = rim_votes(grey, w, h, f, b);
        for (double step = b / 2; step > b / 20; step /= 2)
            for (int moved = 1, it = 0; moved && it < 20; it++) {
                circle_found from = *f;
                moved = 0;
                for (int m = 0; m < 27; m++) {
                    circle_found t = from;
                    t.x += step * (m % 3 - 1), t.y += step * (m / 3 % 3 - 1), t.r += step * (m / 9 - 1);
                    double v = rim_votes(grey, w, h, &t, b);
                    if (v > best) best = v, *f = t, moved = 1;
                }
            }
    }
}

/* A picture that has been cut to the ball: as wide and as high as the ball within 1.5 %, and the ball in its middle. */
static int is_cut_out(const circle_found *f, int w, int h)
{
    double wide = fmax(fabs(w - 2 * f->r), fabs(h - 2 * f->r)), off = fmax(fabs(w / 2. - f->x), fabs(h / 2. - f->y));
    return wide < 0.03 * f->r && off < 0.03 * f->r;
}

/* The circle, moved and made smaller so that its rim can be seen all around: half a pixel within the frame. */
static void hold_inside(circle_found *f, int w, int h)
{
    f->r = fmin(f->r, (w < h ? w : h) / 2. - 0.5);
    f->x = fmax(f->r + 0.5, fmin(w - f->r - 0.5, f->x)), f->y = fmax(f->r + 0.5, fmin(h - f->r - 0.5, f->y));
}

/* From a ball's strongest circle to its rim.  Its reflections have circles of their own, inside of the rim: where a circle near to the
 * one found has clearly more votes, take that.  There, a clean rim says itself where it is: its strongest edges agree within half a
 * pixel.  Where they don't, as they are reflections' edges in part, or the ball is an oval by perspective, it is the votes that count.
 * And who cuts a ball out keeps it whole: then the frame bounds it, which says more than what an unclean rim gains outside. */
static void to_the_rim(circle_found *f, const float *grey, int w, int h)
{
    circle_found t = *f;
    double step = fmax(f->r / 130, 0.5), b = fmax(f->r / 65, 0.5), best = 1.25 * rim_votes(grey, w, h, f, b);
    for (int r = -2; r <= 9; r++)
        for (int y = -9; y <= 9; y++)
            for (int x = -9; x <= 9; x++) {
                circle_found c = {f->x + x * step, f->y + y * step, f->r + r * step, f->rms, f->share};
                double v = rim_votes(grey, w, h, &c, b);
                if (v > best) best = v, t = c;
            }
    climb_votes(&t, grey, w, h);
    circle_found own = t;
    if (!circle_refine(&own, grey, w, h, CIRCLE_BALL, 3) && own.rms < 0.6) t = own;
    else if (is_cut_out(&t, w, h)) hold_inside(&t, w, h);
    *f = t;
}

int circle_find(circle_found *f, const float *pix, int w, int h, circle_kind kind, double radius, errmsg *e)
{
    candidate c[KEPT];
    circle_found best = {0};
    double quality = 0;
    if (w < 16 || h < 16) return err_set(e, "expected a picture of at least 16 x 16 pixels to find a circle in, found %d x %d", w, h);
    float *grey = circle_grey(pix, w, h);
    if (!grey) return err_set(e, "out of memory");
    int rc = search(c, grey, w, h, kind, radius);
    for (int i = 0; !rc && i < KEPT; i++) {
        if (c[i].score <= 0.05) continue;
        circle_found t = {c[i].x, c[i].y, c[i].r, 0, 0};
        if (circle_refine(&t, grey, w, h, kind, fmax(3, 0.02 * c[i].r))) continue;
        /* much of the rim, close to one circle; large rather than small */
        double q = c[i].score * t.share * sqrt(t.r) / (0.3 + t.rms);
        if (q > quality) quality = q, best = t;
    }
    if (quality > 0 && kind == CIRCLE_BALL) to_the_rim(&best, grey, w, h);
    free(grey);
    if (!(quality > 0)) return err_set(e, "expected a circle that stands out, found none; say where it is (--centre and --radius, or --corners)");
    *f = best;
    return 0;
}
