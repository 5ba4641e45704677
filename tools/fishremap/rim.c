/*
 * rim.c - tracing and weighing a circle's rim (rim.h).
 *
 * The rim is traced as the best closed path around the circle (dynamic programming over rays and radii: no
 * ray is alone in choosing its edge), then a circle is fitted to it.
 */
#include "rim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vision/circles.h"

#define ANGLES    96
#define FAINT     0.03f /* log units per pixel: gradients well above count in full */
#define MOST_RAYS 360
#define STEPS     61    /* radii tried on a ray */
#define SMALL     100.0 /* pixels of radius: below, half a pixel is too much to be off */

static double cosines[ANGLES], sines[ANGLES]; /* set with the first pyramid */

/* Central differences, slightly smoothed along the edge. */
static int gradients(rim_level *l)
{
    int w = l->w, h = l->h;
    size_t n = (size_t)w * (size_t)h;
    l->gx = calloc(n, sizeof(float)), l->gy = calloc(n, sizeof(float));
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

static void level_free(rim_level *l)
{
    free(l->g);
    free(l->gx);
    free(l->gy);
}

static int level_new(rim_level *l, int w, int h, const float *g, int gw, int gh, double kx, double ky,
                     errmsg *e)
{
    *l = (rim_level){.w = w, .h = h, .kx = kx * gw / w, .ky = ky * gh / h};
    l->g = malloc(sizeof(float) * (size_t)w * (size_t)h);
    if (!l->g) return err_set(e, "out of memory");
    if (vision_reduce(l->g, w, h, g, gw, gh, e)) return -1;
    return gradients(l) ? err_set(e, "out of memory") : 0;
}

int rim_pyramid_new(rim_pyramid *p, const float *g, int w, int h, int side, errmsg *e)
{
    memset(p, 0, sizeof *p);
    for (int i = 0; i < ANGLES; i++)
        cosines[i] = cos(2 * M_PI * i / ANGLES), sines[i] = sin(2 * M_PI * i / ANGLES);
    double k = fmax((double)(w > h ? w : h) / side, 1);
    int lw = (int)lrint(w / k), lh = (int)lrint(h / k);
    for (const rim_level *up = NULL; p->n < RIM_LEVELS;
         up = &p->level[p->n - 1], lw = up->w / 2, lh = up->h / 2) {
        if (lw < 8 || lh < 8) break;
        /* an odd column or row is left out, so that halves are halves */
        int failed = up ? level_new(&p->level[p->n], lw, lh, up->g, up->w, up->h, up->kx, up->ky, e)
                        : level_new(&p->level[0], lw, lh, g, w, h, 1, 1, e);
        p->n++;
        if (failed) {
            rim_pyramid_free(p);
            return -1;
        }
        if (lw <= 64 && lh <= 64) break;
    }
    return p->n ? 0 : err_set(e, "expected a picture of at least 8 pixels either way, found %d x %d", w, h);
}

void rim_pyramid_free(rim_pyramid *p)
{
    for (int k = 0; k < p->n; k++) level_free(&p->level[k]);
    p->n = 0;
}

static inline float radial(float *strength, const rim_level *l, circle_kind kind, double px, double py,
                           double co, double si)
{
    if (!(px >= 1 && py >= 1 && px < l->w - 1 && py < l->h - 1)) return NAN;
    int i = (int)px, j = (int)py;
    size_t at = (size_t)j * (size_t)l->w + (size_t)i;
    float gx = l->gx[at], gy = l->gy[at];
    float d = gx * (float)co + gy * (float)si, all = gx * gx + gy * gy,
          t = (2 * d * d - all) / (all + FAINT * FAINT);
    if (strength) *strength = fabsf(d);
    return kind == CIRCLE_LENS && d > 0 ? -fabsf(t) : t;
}

/* The same with the gradient interpolated: a pixel matters on a small circle. */
static float radial_between(float *strength, const rim_level *l, circle_kind kind, double px, double py,
                            double co, double si)
{
    double x = px - 0.5, y = py - 0.5;
    if (!(x >= 1 && y >= 1 && x < l->w - 2 && y < l->h - 2)) return NAN;
    int i = (int)x, j = (int)y;
    float u = (float)(x - i), v = (float)(y - j);
    size_t at = (size_t)j * (size_t)l->w + (size_t)i, w = (size_t)l->w;
    float a = (1 - u) * (1 - v), b = u * (1 - v), c = (1 - u) * v, d = u * v;
    float gx = a * l->gx[at] + b * l->gx[at + 1] + c * l->gx[at + w] + d * l->gx[at + w + 1];
    float gy = a * l->gy[at] + b * l->gy[at + 1] + c * l->gy[at + w] + d * l->gy[at + w + 1];
    float along = gx * (float)co + gy * (float)si, all = gx * gx + gy * gy,
          t = (2 * along * along - all) / (all + FAINT * FAINT);
    *strength = fabsf(along);
    return kind == CIRCLE_LENS && along > 0 ? -fabsf(t) : t;
}

double rim_score(const rim_level *l, circle_kind kind, double x, double y, double r)
{
    float sum = 0;
    int seen = 0;
    for (int k = 0; k < ANGLES; k++) {
        float t = radial(NULL, l, kind, x + r * cosines[k], y + r * sines[k], cosines[k], sines[k]);
        if (isnan(t)) continue;
        seen++, sum += t;
    }
    return seen < ANGLES / 6 ? 0 : (double)sum / seen * sqrt((double)seen / ANGLES);
}

double rim_climb(double c[3], const rim_level *l, circle_kind kind, int free_radius, double from)
{
    double best = rim_score(l, kind, c[0], c[1], c[2]);
    for (double step = from; step > 0.2; step /= 2)
        for (int moved = 1, it = 0; moved && it < 12; it++) {
            double o[3] = {c[0], c[1], c[2]};
            moved = 0;
            for (int m = 0; m < 27; m++) {
                double t[3] = {o[0] + step * (m % 3 - 1), o[1] + step * (m / 3 % 3 - 1),
                               o[2] + (free_radius ? step * (m / 9 - 1) : 0)};
                if (t[2] < 3) continue;
                double s = rim_score(l, kind, t[0], t[1], t[2]);
                if (s > best) best = s, memcpy(c, t, sizeof t), moved = 1;
            }
        }
    return best;
}

/* ---- the rim as a path ----------------------------------------------------------------------------------
 */

typedef struct unwrapped {
    int n;         /* rays */
    double r0, dr; /* radius of step k: r0 + k dr */
    double co[MOST_RAYS], si[MOST_RAYS];
    float v[MOST_RAYS][STEPS]; /* how much of an edge along the circle; < 0: out of the picture */
    int path[MOST_RAYS];
} unwrapped;

static void unwrap(unwrapped *u, const rim_level *l, circle_kind kind, const double c[3], double band)
{
    double half = fmax(band * c[2], 1.5);
    u->n = (int)fmin(MOST_RAYS, fmax(48, rint(M_PI * c[2])));
    u->dr = 2 * half / (STEPS - 1), u->r0 = c[2] - half;
    for (int k = 0; k < u->n; k++) {
        double co = cos(2 * M_PI * k / u->n), si = sin(2 * M_PI * k / u->n);
        u->co[k] = co, u->si[k] = si;
        for (int q = 0; q < STEPS; q++) {
            double r = u->r0 + q * u->dr;
            float strength = 0, t = (c[2] < SMALL ? radial_between : radial)(
                                    &strength, l, kind, c[0] + r * co, c[1] + r * si, co, si);
            u->v[k][q] = isnan(t) ? -1 : fmaxf(t, 0) * (0.5f + 0.6f * strength / (strength + 0.1f));
        }
    }
}

/* The best path around: a step between rays of at most `most` radii, which costs a little.  Twice around, so
 * that it closes. */
static void best_path(unwrapped *u)
{
    static const float bend = 0.02f;
    float(*sum)[STEPS] = calloc((size_t)(2 * u->n), sizeof *sum);
    signed char(*from)[STEPS] = calloc((size_t)(2 * u->n), sizeof *from);
    int most = (int)fmax(1, fmin(4, ceil(0.7 / u->dr)));
    if (!sum || !from) {
        for (int k = 0; k < u->n; k++) u->path[k] = STEPS / 2;
        goto done;
    }
    for (int k = 0; k < 2 * u->n; k++)
        for (int q = 0; q < STEPS; q++) {
            float best = 0;
            int at = 0;
            for (int d = -most; k && d <= most; d++) {
                if (q + d < 0 || q + d >= STEPS) continue;
                float s = sum[k - 1][q + d] - bend * (float)abs(d);
                if (d == -most || (q + d == 0) || s > best) best = s, at = d;
            }
            sum[k][q] = best + fmaxf(u->v[k % u->n][q], 0);
            from[k][q] = (signed char)at;
        }
    int q = 0;
    for (int i = 0; i < STEPS; i++)
        if (sum[2 * u->n - 1][i] > sum[2 * u->n - 1][q]) q = i;
    for (int k = 2 * u->n - 1; k > 0; k--) {
        if (k < u->n + u->n / 2 && k >= u->n / 2) u->path[k % u->n] = q;
        q += from[k][q];
    }
done:
    free(sum);
    free(from);
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Weighted algebraic circle fit (Kasa): good inside a reweighted loop near the answer; a known radius moves
 * the centre alone. */
static int fit_circle(double c[3], const double *px, const double *py, const double *wt, int n,
                      int free_radius)
{
    double s[6] = {0}, mx = 0, my = 0, sw = 0;
    for (int i = 0; i < n; i++) mx += wt[i] * px[i], my += wt[i] * py[i], sw += wt[i];
    if (!(sw > 0)) return -1;
    mx /= sw, my /= sw;
    for (int i = 0; i < n; i++) {
        double u = px[i] - mx, v = py[i] - my, q = u * u + v * v;
        s[0] += wt[i] * u * u, s[1] += wt[i] * u * v, s[2] += wt[i] * v * v;
        s[3] += wt[i] * u * q, s[4] += wt[i] * v * q, s[5] += wt[i] * q;
    }
    double det = s[0] * s[2] - s[1] * s[1];
    if (!(det > 1e-6 * s[0] * s[2])) return -1;
    double a = (s[3] * s[2] - s[4] * s[1]) / (2 * det), b = (s[4] * s[0] - s[3] * s[1]) / (2 * det);
    c[0] = mx + a, c[1] = my + b;
    if (free_radius) c[2] = sqrt(s[5] / sw + a * a + b * b);
    return 0;
}

/* Robust fit to the path: points that stray lose their weight (Tukey). */
static int fit_path(double c[3], const unwrapped *u, int free_radius)
{
    double px[MOST_RAYS], py[MOST_RAYS], base[MOST_RAYS], wt[MOST_RAYS], dev[MOST_RAYS],
        o[3] = {c[0], c[1], c[2]};
    int n = 0;
    for (int k = 0; k < u->n; k++) {
        float v = u->v[k][u->path[k]];
        if (v <= 0.1f) continue;
        double r = u->r0 + u->path[k] * u->dr;
        px[n] = o[0] + r * u->co[k], py[n] = o[1] + r * u->si[k], base[n] = wt[n] = (double)v, n++;
    }
    if (n < u->n / 8 || n < 8) return -1;
    for (int it = 0; it < 12; it++) {
        if (fit_circle(c, px, py, wt, n, free_radius)) return -1;
        for (int i = 0; i < n; i++) dev[i] = fabs(hypot(px[i] - c[0], py[i] - c[1]) - c[2]);
        double sorted[MOST_RAYS];
        memcpy(sorted, dev, sizeof(double) * (size_t)n);
        qsort(sorted, (size_t)n, sizeof *sorted, by_value);
        double scale = fmax(4.685 * 1.4826 * sorted[n / 2], 0.5);
        for (int i = 0; i < n; i++) {
            double q = dev[i] / scale;
            wt[i] = q < 1 ? base[i] * (1 - q * q) * (1 - q * q) : 0;
        }
    }
    return isfinite(c[0] + c[1] + c[2]) ? 0 : -1;
}

float rim_grey(const rim_level *l, double x, double y)
{
    x -= 0.5, y -= 0.5;
    if (!(x >= 0 && y >= 0 && x < l->w - 1 && y < l->h - 1)) return NAN;
    int i = (int)x, j = (int)y;
    float u = (float)(x - i), v = (float)(y - j);
    const float *p = l->g + (size_t)j * (size_t)l->w + (size_t)i;
    return (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[l->w] + u * p[l->w + 1]);
}

static double ring(const rim_level *l, circle_kind kind, const double c[3], double a, double b)
{
    double sum = 0, n = 0;
    for (int q = 0; q < 6; q++) {
        double r = c[2] * (a + (b - a) * (q + 0.5) / 6);
        for (int k = 0; k < ANGLES; k++) {
            float t = radial(NULL, l, kind, c[0] + r * cosines[k], c[1] + r * sines[k], cosines[k], sines[k]);
            if (!isnan(t)) sum += (double)t, n++;
        }
    }
    return n > 0 ? sum / n : 0;
}

static void weigh(rim_fit *f, const unwrapped *u, const rim_level *l, circle_kind kind, const double o[3],
                  const double c[3])
{
    double contrast[MOST_RAYS], sq = 0, along = 0, two[2] = {0, 0}, tol = fmax(0.015 * c[2], 1);
    int seen = 0, good = 0;
    *f = (rim_fit){.x = c[0], .y = c[1], .r = c[2]};
    for (int k = 0; k < u->n; k++) {
        double r = u->r0 + u->path[k] * u->dr, x = o[0] + r * u->co[k], y = o[1] + r * u->si[k];
        double d = hypot(x - c[0], y - c[1]), co = (x - c[0]) / d, si = (y - c[1]) / d, off = d - c[2];
        float t = radial(NULL, l, kind, x, y, co, si), in = rim_grey(l, x - 1.5 * co, y - 1.5 * si),
              out = rim_grey(l, x + 1.5 * co, y + 1.5 * si);
        if (isnan(t) || isnan(in) || isnan(out)) continue;
        contrast[seen++] = (double)fabsf(in - out);
        along += (double)t;
        if (t < 0.5f || fabs(off) > tol) continue;
        good++, sq += off * off;
        two[0] += off * (co * co - si * si), two[1] += off * 2 * co * si;
    }
    if (!seen) return;
    qsort(contrast, (size_t)seen, sizeof *contrast, by_value);
    f->seen = (double)seen / u->n, f->share = (double)good / seen, f->contrast = contrast[seen / 2],
    f->along = along / seen;
    if (good) f->rms = sqrt(sq / good) / c[2], f->oval = 2 * hypot(two[0], two[1]) / good / c[2];
    double gap = fmax(0.03, 3 / c[2]),
           far = gap + fmax(0.09, 3 / c[2]); /* the rim's own edge reaches 2 pixels */
    f->inside = ring(l, kind, c, 1 - far, 1 - gap), f->outside = ring(l, kind, c, 1 + gap, 1 + far);
}

int rim_trace(rim_fit *f, const rim_level *l, circle_kind kind, int free_radius, const double start[3],
              double band)
{
    unwrapped *u = malloc(sizeof *u);
    double c[3] = {start[0], start[1], start[2]}, o[3];
    int rc = u ? 0 : -1;
    for (int pass = 0; !rc && pass < 3; pass++, band = fmax(band / 2, 0.02)) {
        memcpy(o, c, sizeof o);
        unwrap(u, l, kind, c, band);
        best_path(u);
        rc = fit_path(c, u, free_radius);
        if (!rc && (hypot(c[0] - start[0], c[1] - start[1]) > 0.3 * start[2] ||
                    fabs(c[2] - start[2]) > 0.3 * start[2]))
            rc = -1;
    }
    if (!rc) weigh(f, u, l, kind, o, c);
    free(u);
    return !rc && f->share > 0.1 ? 0 : -1;
}
