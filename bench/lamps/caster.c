/*
 * caster.c - radiance along rays in rooms of simple bodies, for tuning and judging ilflamps.
 *
 * A room is an axis-parallel box, lit as its walls' pattern says, with balls, rectangles, ellipses and
 * capsules in it.  Bodies that are lamps emit, may have a beam (radiance times cos^k of the angle from an
 * axis) and may be a profile projector: of the lens only those rays shine that cross the plane z = focus
 * within a circle.  One wall may be a mirror.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BALL, QUAD, ELLIPSE, ROD, SUN };
typedef struct {
    int kind, lamp, gate, spare;
    double c[3], u[3], v[3], r, L[3]; /* centre; half axes (ROD: the other end in u); radius */
    double axis[3], k;                /* beam, k = 0: none */
    double focus, gx, gy, gr, soft;   /* gate: plane z = focus, circle's centre, radius, softness */
    double amp, cell;                 /* checker of a rectangle */
} body;
typedef struct {
    double lo[3], hi[3], amp, cell, bright, mirror,
        phase; /* mirror: reflectance of the wall x = hi, 0: none */
    int n, spare;
    const body *b;
} room;

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static void sub(double *r, const double *a, const double *b)
{
    for (int c = 0; c < 3; c++) r[c] = a[c] - b[c];
}
static void cross(double *r, const double *a, const double *b)
{
    r[0] = a[1] * b[2] - a[2] * b[1], r[1] = a[2] * b[0] - a[0] * b[2], r[2] = a[0] * b[1] - a[1] * b[0];
}

static int checker(double a, double b, double c, double cell)
{
    return ((long)floor(a / cell + .0131) + (long)floor(b / cell + .0173) + (long)floor(c / cell + .0119)) &
           1;
}

static double ball_at(const double *o, const double *d, const double *c, double r)
{
    double e[3];
    sub(e, c, o);
    const double m = dot(e, d), q = m * m - dot(e, e) + r * r;
    return q > 0 && m > 0 && m - sqrt(q) > 0 ? m - sqrt(q) : 1e30;
}

static double rod_at(const double *o, const double *d, const body *b)
{
    double a[3], e[3];
    sub(a, b->u, b->c), sub(e, o, b->c);
    const double aa = dot(a, a), ad = dot(a, d), ae = dot(a, e), A = aa - ad * ad,
                 B = aa * dot(d, e) - ad * ae, C = aa * (dot(e, e) - b->r * b->r) - ae * ae,
                 h = B * B - A * C;
    if (h < 0 || A <= 0) return 1e30;
    const double t = (-B - sqrt(h)) / A, s = ae + t * ad;
    if (s < 0) return ball_at(o, d, b->c, b->r);
    if (s > aa) return ball_at(o, d, b->u, b->r);
    return t > 1e-9 ? t : 1e30;
}

static double flat_at(double *st, const double *o, const double *d, const body *b)
{
    double n[3], e[3], h[3];
    cross(n, b->u, b->v), sub(e, b->c, o);
    const double dn = dot(d, n);
    if (fabs(dn) < 1e-14) return 1e30;
    const double t = dot(e, n) / dn;
    if (t < 1e-9) return 1e30;
    for (int c = 0; c < 3; c++) h[c] = t * d[c] - e[c];
    st[0] = dot(h, b->u) / dot(b->u, b->u), st[1] = dot(h, b->v) / dot(b->v, b->v);
    return (b->kind == QUAD ? fmax(fabs(st[0]), fabs(st[1])) <= 1 : st[0] * st[0] + st[1] * st[1] <= 1)
               ? t
               : 1e30;
}

static double shine(const body *b, const double *o, const double *d)
{
    double f = 1;
    if (b->k > 0) f = pow(fmax(0, -dot(d, b->axis)), b->k);
    if (b->gate) {
        const double t = (b->focus - o[2]) / d[2], x = o[0] + t * d[0] - b->gx, y = o[1] + t * d[1] - b->gy;
        const double s = (b->gr - sqrt(x * x + y * y)) / b->soft + .5;
        f *= s <= 0 ? 0 : s >= 1 ? 1 : s * s * (3 - 2 * s);
    }
    return f;
}

static double wall(const room *w, const double *o, const double *d, double *L, int *side)
{
    double t = 1e30, x[3];
    for (int c = 0; c < 3; c++) {
        if (d[c] == 0) continue;
        const double u = ((d[c] > 0 ? w->hi[c] : w->lo[c]) - o[c]) / d[c];
        if (u < t) t = u, *side = 2 * c + (d[c] > 0);
    }
    for (int c = 0; c < 3; c++) x[c] = o[c] + t * d[c];
    double v = w->bright * (1 + .35 * sin(x[0] + w->phase) * cos(.8 * x[1] - w->phase) +
                            .2 * sin(1.7 * x[2] + 2 * w->phase));
    if (w->amp > 0) v *= 1 + w->amp * (checker(x[0], x[1], x[2], w->cell) ? 1 : -1);
    if (*side == 5) v *= 1.5;
    L[0] = v * (1 + .2 * cos(x[0])), L[1] = v, L[2] = v * (1 + .25 * sin(x[1]));
    return t;
}

static double look(const room *w, const double *o, const double *d, const int *which, int n, double *L,
                   int depth)
{
    int side = 0, hit = -1;
    double st[2] = {0, 0}, best[2] = {0, 0}, t = wall(w, o, d, L, &side);

    for (int i = 0; i < n; i++) {
        const body *b = w->b + which[i];
        double u = 1e30;
        if (b->kind == BALL) u = ball_at(o, d, b->c, b->r);
        else if (b->kind == ROD) u = rod_at(o, d, b);
        else if (b->kind == SUN) u = dot(d, b->c) > cos(b->r) ? t * (1 - 1e-9) : 1e30;
        else u = flat_at(st, o, d, b);
        if (u < t) t = u, hit = which[i], best[0] = st[0], best[1] = st[1];
    }
    if (hit >= 0) {
        const body *b = w->b + hit;
        double f = b->lamp ? shine(b, o, d) : 1;
        if (b->amp > 0)
            f *= 1 + b->amp * (checker(best[0] * sqrt(dot(b->u, b->u)), best[1] * sqrt(dot(b->v, b->v)), 0,
                                       b->cell)
                                   ? 1
                                   : -1);
        for (int c = 0; c < 3; c++) L[c] = f * b->L[c];
    } else if (w->mirror > 0 && side == 1 && !depth) {
        double x[3], e[3] = {-d[0], d[1], d[2]};
        int all[4096], m = w->n < 4096 ? w->n : 4096;
        for (int i = 0; i < m; i++) all[i] = i;
        for (int c = 0; c < 3; c++) x[c] = o[c] + (t - 1e-7) * d[c];
        look(w, x, e, all, m, L, 1);
        for (int c = 0; c < 3; c++) L[c] *= w->mirror;
    }
    return t;
}

static void bound(const body *b, double *c, double *r)
{
    memcpy(c, b->c, 3 * sizeof *c), *r = b->r;
    if (b->kind == QUAD) *r = sqrt(dot(b->u, b->u) + dot(b->v, b->v));
    if (b->kind == ELLIPSE) *r = sqrt(fmax(dot(b->u, b->u), dot(b->v, b->v)));
    if (b->kind == ROD) {
        double e[3];
        sub(e, b->u, b->c);
        for (int k = 0; k < 3; k++) c[k] += .5 * e[k];
        *r += .5 * sqrt(dot(e, e));
    }
}

/* Bodies that may be met within `half` of direction m; 1 if a lamp is among them, or near. */
static int near_bodies(const room *w, const double *o, const double *m, double half, double more, int *which,
                       int *n)
{
    int lamp = 0;
    *n = 0;
    for (int i = 0; i < w->n; i++) {
        double c[3], r, a;
        const body *b = w->b + i;
        if (b->kind == SUN) a = acos(fmin(1, dot(m, b->c))) - b->r;
        else {
            bound(b, c, &r), sub(c, c, o);
            const double l = sqrt(dot(c, c));
            a = l <= r ? 0 : acos(fmax(-1, fmin(1, dot(c, m) / l))) - asin(r / l);
        }
        if (a < half) which[(*n)++] = i;
        if (b->lamp && a < half + more) lamp = 1;
    }
    return lamp;
}

void rays(const room *w, long n, const double *o, const double *d, double *L, double *hit)
{
#pragma omp parallel
    {
        int *which = malloc((size_t)(w->n + 1) * sizeof *which), k;
#pragma omp for schedule(dynamic, 1024)
        for (long i = 0; i < n; i++) {
            double P[3];
            int side;
            near_bodies(w, o + 3 * i, d + 3 * i, 1e-6, 0, which, &k);
            look(w, o + 3 * i, d + 3 * i, which, k, L + 3 * i, 0);
            const double t = wall(w, o + 3 * i, d + 3 * i, P, &side);
            for (int c = 0; c < 3; c++) hit[3 * i + c] = o[3 * i + c] + t * d[3 * i + c];
        }
        free(which);
    }
}

/* A direction in a camera's own axes (R: forward, left, up as rows; NULL: none) in the room's. */
static void outward(double d[3], const double *R, double p, double q)
{
    const double e[3] = {sin(p) * cos(q), sin(p) * sin(q), cos(p)};

    for (int c = 0; c < 3; c++) d[c] = R ? e[0] * R[c] + e[1] * R[3 + c] + e[2] * R[6 + c] : e[c];
}

/* Area means over a map's texels, S x S rays each, more where bodies (2S) and lamps (fine) are. */
static void map(const room *w, const double *o, const double *R, double edge, int n_lat, int n_lon, int S, int fine,
                float *out)
{
    const double pi = acos(-1), dp = edge / n_lat, dt = 2 * pi / n_lon;
#pragma omp parallel
    {
        int *which = malloc((size_t)(w->n + 1) * sizeof *which), k;
#pragma omp for schedule(dynamic, 1)
        for (int y = 0; y < n_lat; y++)
            for (int x = 0; x < n_lon; x++) {
                double sum[3] = {0, 0, 0}, weight = 0, p = (y + .5) * dp, q = (x + .5) * dt - pi, L[3];
                double m[3];
                outward(m, R, p, q);
                const double half = .5 * hypot(dp, dt * sin(fmin(p + dp / 2, pi / 2))) + 1e-4;
                int s = near_bodies(w, o, m, half, half, which, &k) ? fine : k ? 2 * S : S;
                if (w->mirror > 0 && m[0] > .3) s = 3 * S;
                for (int a = 0; a < s; a++)
                    for (int b = 0; b < s; b++) {
                        p = (y + (a + .5) / s) * dp, q = (x + (b + .5) / s) * dt - pi;
                        double e[3];
                        outward(e, R, p, q);
                        look(w, o, e, which, k, L, 0);
                        for (int c = 0; c < 3; c++) sum[c] += sin(p) * L[c];
                        weight += sin(p);
                    }
                for (int c = 0; c < 3; c++) out[((long)y * n_lon + x) * 3 + c] = (float)(sum[c] / weight);
            }
        free(which);
    }
}

/* One probe of the upper hemisphere, in axes of its own (R as above). */
void probe(const room *w, const double *o, const double *R, int n_lat, int n_lon, int S, int fine, float *out)
{
    map(w, o, R, acos(-1) / 2, n_lat, n_lon, S, fine, out);
}

/* All of the sphere in a camera's own axes; azimuth from forward to the left. */
void sphere(const room *w, const double *o, const double *R, int n_lat, int n_lon, int S, int fine, float *out)
{
    map(w, o, R, acos(-1), n_lat, n_lon, S, fine, out);
}
