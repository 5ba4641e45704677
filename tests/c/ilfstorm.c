/*
 * ilfstorm.c - test driver: rays by the million, random and adversarial, and what must hold for their
 * radiance.
 *
 *   ilfstorm rays FILE SEED N SCALE             N rays as ilftrace takes them, of the scene scaled about the
 *                                               world's origin
 *   ilfstorm plane FILE SCALE                   the scaled plane as ilftrace --plane takes it
 *   ilfstorm check FILE SEED N MODE < radiance  what ilftrace answered: finite, not negative, not above the
 *                                               brightest texel, and continuous; prints counts and the worst
 *   ilfstorm lib FILE SEED N                    the same straight through libilf, in both modes, and at
 *                                               scales 1e-6 to 1e6
 *
 * Rays come in pairs that differ by 1e-7 to 1e-12 of the plane's size.  How much their radiance may differ
 * follows from the file's texels and the lookup's definition (docs/FORMAT.md, section 2):
 *
 *   |dL| <= K dw + R (|ds| + |dt|),  K = (Gx n_theta/2pi) / sin(phi) + max(Gy, 2 Gm) n_phi/polarMax
 *
 * dw = angle between the directions in which a probe is looked up, (s, t) grid coordinates, Gx, Gy = largest
 * steps between neighbouring texels of a row and a column, Gm = of the first (last) row from its mean, R =
 * range of all texels; sin(phi) is taken no smaller than half a row from a pole, for there the row's weight
 * falls with phi.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ilf.h"

#define PI 3.14159265358979324

typedef struct ray {
    double o[3], d[3], h[3];
} ray;

typedef struct steps {
    double gx, gy, gm, range, most, mean;
} steps;

/* ---- random numbers: splitmix64 by counter ------------------------------------------------------- */

static uint64_t state;

static double uniform(void)
{
    uint64_t z = state += 0x9e3779b97f4a7c15u;

    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

static double between(double lo, double hi)
{
    return lo + (hi - lo) * uniform();
}

/* 10^lo to 10^hi, either sign */
static double tiny(double lo, double hi)
{
    const double x = pow(10, between(lo, hi));
    return uniform() < .5 ? x : -x;
}

/* ---- rays in the plane's coordinates: lengths u, v, height n ------------------------------------------ */

enum { KINDS = 8 };

static void plane_ray(double d[3], double h[3], const ilf_info *in, const ilf_frame *f, int kind)
{
    const double size = fmax(f->len_u, f->len_v), a = between(-PI, PI);
    const int i = (int)between(0, in->n_u), j = (int)between(0, in->n_v);
    double qu = in->n_u == 1 ? .5 * f->len_u : f->len_u * i / (in->n_u - 1);
    double qv = in->n_v == 1 ? .5 * f->len_v : f->len_v * j / (in->n_v - 1), c = between(-.2, 1);

    d[0] = cos(a) * sqrt(1 - c * c), d[1] = sin(a) * sqrt(1 - c * c), d[2] = c;
    h[0] = between(-.5, 1.5) * f->len_u, h[1] = between(-.5, 1.5) * f->len_v,
    h[2] = size * pow(10, between(-3, 1));
    switch (kind) {
    case 0: /* anything */ break;
    case 1: /* nearly parallel to the plane */
        d[0] = cos(a), d[1] = sin(a), d[2] = pow(10, between(-16, -1));
        break;
    case 2: /* straight up, above a probe */
        d[0] = tiny(-14, -1), d[1] = tiny(-14, -1), d[2] = 1;
        h[0] = qu + size * tiny(-14, -1), h[1] = qv + size * tiny(-14, -1);
        break;
    case 3: /* the seam */
        d[0] = -between(.01, 1), d[1] = tiny(-16, -2), d[2] = between(.01, 1);
        h[0] = qu - h[2] * between(.1, 1), h[1] = qv + size * tiny(-16, -2);
        break;
    case 4: /* back onto lines of probes and the plane's edge */
        h[0] = qu + d[0] / fmax(d[2], .01) * h[2] + size * tiny(-16, -2);
        h[1] = qv + d[1] / fmax(d[2], .01) * h[2] + size * tiny(-16, -2);
        break;
    case 5: /* at a probe */
        h[0] = qu + size * tiny(-13, -1), h[1] = qv + size * tiny(-13, -1), h[2] = size * tiny(-13, -1);
        break;
    case 6: { /* polar angles where something ends */
        const double rows = in->polar_max / in->n_phi;
        const double ends[] = {in->polar_valid, in->polar_max, in->polar_max - .5 * rows, .5 * rows, PI / 2};
        const double p = ends[(int)between(0, 5)] + tiny(-14, -2), far = size * between(.1, 2);
        d[0] = sin(p) * cos(a), d[1] = sin(p) * sin(a), d[2] = cos(p);
        h[0] = qu + far * d[0], h[1] = qv + far * d[1], h[2] = far * d[2];
        break;
    }
    default: /* far away, or below the plane */
        h[2] = size * tiny(-2, 12);
        if (uniform() < .5) h[0] = size * tiny(0, 12), h[1] = size * tiny(0, 12);
        break;
    }
}

static void to_world(double w[3], const ilf_frame *f, const double p[3], int is_point)
{
    for (int c = 0; c < 3; c++)
        w[c] = (is_point ? f->origin[c] : 0) + p[0] * f->u[c] + p[1] * f->v[c] + p[2] * f->n[c];
}

/* The pair of rays number k. */
static void make_pair(ray r[2], const ilf_info *in, const ilf_frame *f, uint64_t seed, uint64_t k)
{
    double d[3], h[3], o[3];
    const double size = fmax(f->len_u, f->len_v);

    state = seed * 0x2545f4914f6cdd1du + k * 0xda942042e4dd58b5u;
    plane_ray(d, h, in, f, (int)(k % KINDS));
    const double off = pow(10, between(-12, -7));
    const double reach = size + fabs(h[0]) + fabs(h[1]) + fabs(h[2]);
    for (int m = 0; m < 2; m++) {
        for (int c = 0; c < 3; c++) {
            o[c] = h[c] - d[c] * size * .25;
            if (m)
                h[c] += off * between(-1, 1) * (k % KINDS == 7 ? reach : size),
                    d[c] += off * between(-1, 1) * (c == 2 ? fabs(d[2]) : 1);
        }
        to_world(r[m].o, f, o, 1);
        to_world(r[m].d, f, d, 0);
        to_world(r[m].h, f, h, 1);
    }
}

/* ---- what may differ ------------------------------------------------------------------------------ */

static int measure(steps *g, const ilf *field)
{
    const ilf_info *in = ilf_get_info(field);
    const size_t w = (size_t)in->n_theta, n = w * (size_t)in->n_phi;
    float *t = malloc(n * 3 * sizeof *t);
    double least = HUGE_VAL, sum = 0;
    ilf_error err;

    memset(g, 0, sizeof *g);
    for (int j = 0; t && j < in->n_v; j++)
        for (int i = 0; i < in->n_u; i++) {
            if (ilf_read_probe(t, field, i, j, &err) != ILF_OK) {
                fprintf(stderr, "%s\n", err.text);
                return -1;
            }
            for (size_t k = 0; k < n * 3; k++) {
                const size_t x = k / 3 % w, row = k - 3 * x - k % 3;
                const double v = (double)t[k], right = (double)t[row + 3 * ((x + 1) % w) + k % 3];
                least = fmin(least, v), g->most = fmax(g->most, v), sum += v;
                g->gx = fmax(g->gx, fabs(right - v));
                if (k + 3 * w < 3 * n) g->gy = fmax(g->gy, fabs((double)t[k + 3 * w] - v));
            }
        }
    free(t);
    g->range = g->most - least;
    g->gm = g->range; /* no farther than that from the mean */
    g->mean = sum / (double)(n * 3) / in->n_u / in->n_v;
    return t ? 0 : -1;
}

static void in_frame(double p[3], const ilf_frame *f, const double w[3], int is_point)
{
    double rel[3];

    for (int c = 0; c < 3; c++) rel[c] = w[c] - (is_point ? f->origin[c] : 0);
    for (int c = 0; c < 3; c++) {
        const double *axis = c == 0 ? f->u : c == 1 ? f->v : f->n;
        p[c] = rel[0] * axis[0] + rel[1] * axis[1] + rel[2] * axis[2];
    }
}

static double grid(double x, double len, int n)
{
    return n == 1 ? 0 : fmin(fmax(x / len * (n - 1), 0), n - 1);
}

static double length(const double a[3])
{
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

/* Largest difference that the definition allows; negative where it allows any (the horizon's cut). */
static double allowed(const steps *g, const ilf_info *in, const ilf_frame *f, const ray r[2], int depth)
{
    double d[2][3], h[2][3], s[2], t[2], turn = 0, low = 1;
    const double row = in->polar_max / in->n_phi;

    for (int m = 0; m < 2; m++) {
        in_frame(d[m], f, r[m].d, 0);
        in_frame(h[m], f, r[m].h, 1);
        if (!(d[m][2] > 0)) return -1;
        s[m] = grid(h[m][0] - d[m][0] / d[m][2] * h[m][2], f->len_u, in->n_u);
        t[m] = grid(h[m][1] - d[m][1] / d[m][2] * h[m][2], f->len_v, in->n_v);
    }
    for (int m = 0; m < (depth ? 2 : 1); m++)
        for (int k = 0; k < (depth ? 4 : 1); k++) {
            const int i = (int)fmin(floor(s[m]) + (k & 1), in->n_u - 1),
                      j = (int)fmin(floor(t[m]) + (k >> 1), in->n_v - 1);
            const double qu = in->n_u == 1 ? .5 * f->len_u : f->len_u * i / (in->n_u - 1);
            const double qv = in->n_v == 1 ? .5 * f->len_v : f->len_v * j / (in->n_v - 1);
            const double q[3] = {qu + qv * f->cos_uv, qv + qu * f->cos_uv,
                                 0}; /* U and V may be 1e-4 off a right angle */
            double look[2][3], apart[3];
            for (int x = 0; x < 2; x++) {
                for (int c = 0; c < 3; c++) look[x][c] = depth ? h[x][c] - q[c] : d[x][c];
                double len = length(look[x]);
                if (!(len > 0)) return -1; /* on the probe itself: any direction */
                for (int c = 0; c < 3; c++) look[x][c] /= len;
            }
            for (int c = 0; c < 3; c++) apart[c] = look[0][c] - look[1][c];
            /* what rounding of the coordinates alone can turn */
            const double far = depth ? fmin(hypot(h[0][0] - q[0], hypot(h[0][1] - q[1], h[0][2])),
                                            hypot(h[1][0] - q[0], hypot(h[1][1] - q[1], h[1][2])))
                                     : 1;
            const double coarse = depth ? 8e-16 *
                                              (length(f->origin) + fabs(h[0][0]) + fabs(h[0][1]) +
                                               fabs(h[0][2]) + f->len_u + f->len_v) /
                                              far
                                        : 8e-16;
            turn = fmax(turn, length(apart) + coarse);
            for (int x = 0; x < 2; x++) {
                /* without a whole sphere the direction straight down is a pole without a mean */
                const double sine = hypot(look[x][0], look[x][1]);
                if (look[x][2] < 0 && fabs(in->polar_max - PI) > 1e-6) low = fmin(low, sine - length(apart));
            }
        }
    const double sine = fmin(sin(.5 * row), fmax(low, 1e-30));
    /* rounding of the height and of d.n, both of which the back-traced point divides by d.n */
    const double where = length(f->origin) + fabs(h[0][0]) + fabs(h[0][1]) + fabs(h[0][2]), up = d[0][2];
    const double coarse =
        8e-16 * (where * (1 + 1 / up) + fabs(h[0][2]) / (up * up)) / fmin(f->len_u, f->len_v);
    const double k = g->gx * in->n_theta / (2 * PI) / sine + fmax(g->gy, 2 * g->gm) / row;
    return 1.02 * (k * turn +
                   g->range * (fabs(s[0] - s[1]) + fabs(t[0] - t[1]) + coarse * (in->n_u + in->n_v))) +
           1e-6 * g->most;
}

/* ---- bookkeeping ---------------------------------------------------------------------------------- */

typedef struct tally {
    long rays, bad, negative, above, pairs, jumps, scaled, unequal;
    double worst, worst_scale; /* largest difference as a part of what is allowed; of scales, relative */
} tally;

static void judge(tally *t, const float rgb[2][3], const steps *g, double bound, uint64_t k)
{
    for (int m = 0; m < 2; m++) {
        t->rays++;
        for (int c = 0; c < 3; c++) {
            t->bad += !isfinite(rgb[m][c]);
            t->negative += rgb[m][c] < 0;
            t->above += (double)rgb[m][c] > g->most * (1 + 1e-6);
        }
    }
    if (bound < 0) return;
    t->pairs++;
    int jump = 0;
    for (int c = 0; c < 3; c++) {
        const double part = fabs((double)rgb[0][c] - (double)rgb[1][c]) / bound;
        t->worst = fmax(t->worst, part);
        jump |= !(part <= 1);
    }
    if (jump && t->jumps++ < 3)
        fprintf(stderr, "pair %llu (kind %d) jumps\n", (unsigned long long)k, (int)(k % KINDS));
}

static int report(const tally *t)
{
    printf("rays %ld nonfinite %ld negative %ld above %ld pairs %ld jumps %ld worst_jump %.4g scaled %ld "
           "unequal %ld worst_scale %.3g\n",
           t->rays, t->bad, t->negative, t->above, t->pairs, t->jumps, t->worst, t->scaled, t->unequal,
           t->worst_scale);
    return t->bad || t->negative || t->above || t->jumps || t->unequal;
}

static void scaled_frame(ilf_frame *out, const ilf_frame *f, double scale)
{
    double o[3], u[3], v[3];
    ilf_error err;

    for (int c = 0; c < 3; c++)
        o[c] = f->origin[c] * scale, u[c] = f->u[c] * f->len_u * scale, v[c] = f->v[c] * f->len_v * scale;
    if (ilf_frame_init(out, o, u, v, f->n, &err) != ILF_OK) {
        fprintf(stderr, "%s\n", err.text);
        exit(1);
    }
}

static void scale_ray(ray *r, double scale)
{
    for (int c = 0; c < 3; c++) r->o[c] *= scale, r->h[c] *= scale;
}

/* ---- the four commands ----------------------------------------------------------------------------- */

static int give_rays(const ilf *field, uint64_t seed, uint64_t n, double scale)
{
    for (uint64_t k = 0; k < n / 2; k++) {
        ray r[2];
        make_pair(r, ilf_get_info(field), ilf_get_frame(field), seed, k);
        for (int m = 0; m < 2; m++) {
            scale_ray(&r[m], scale);
            const double *o = r[m].o, *d = r[m].d, *h = r[m].h;
            if (printf("%a %a %a %a %a %a %a %a %a\n", o[0], o[1], o[2], d[0], d[1], d[2], h[0], h[1], h[2]) <
                0)
                return 1;
        }
    }
    return fflush(stdout) != 0;
}

static int check(const ilf *field, uint64_t seed, uint64_t n, int depth)
{
    steps g;
    tally t = {0};
    char line[256];

    if (measure(&g, field) != 0) return 1;
    for (uint64_t k = 0; k < n / 2; k++) {
        ray r[2];
        float rgb[2][3];
        for (int m = 0; m < 2; m++) {
            char *end = line;
            if (!fgets(line, sizeof line, stdin)) {
                fprintf(stderr, "expected %llu lines\n", (unsigned long long)n);
                return 1;
            }
            for (int c = 0; c < 3; c++) rgb[m][c] = strtof(end, &end);
        }
        make_pair(r, ilf_get_info(field), ilf_get_frame(field), seed, k);
        judge(&t, (const float(*)[3])rgb, &g,
              allowed(&g, ilf_get_info(field), ilf_get_frame(field), r, depth), k);
    }
    return report(&t);
}

static int through_lib(const ilf *field, uint64_t seed, uint64_t n)
{
    static const double scales[] = {1e-6, 1e-3, 1e3, 1e6};
    const ilf_info *in = ilf_get_info(field);
    const ilf_frame *f = ilf_get_frame(field);
    ilf_frame frames[4];
    steps g;
    tally t = {0};
    ilf_error err;

    if (measure(&g, field) != 0) return 1;
    for (int x = 0; x < 4; x++) scaled_frame(&frames[x], f, scales[x]);
    for (uint64_t k = 0; k < n / 2; k++) {
        ray r[2];
        float rgb[2][3], other[3];
        const int mode = (int)(k / KINDS % 3), x = (int)(k / KINDS / 3 % 4);
        make_pair(r, in, f, seed, k);
        for (int m = 0; m < 2; m++)
            if (ilf_eval(rgb[m], field, f, r[m].o, r[m].d, mode == 2 ? NULL : r[m].h,
                         mode ? ILF_NO_DEPTH : ILF_DEPTH, &err) != ILF_OK) {
                fprintf(stderr, "%s\n", err.text);
                return 1;
            }
        if (mode == 2)
            for (int m = 0; m < 2; m++) memcpy(r[m].h, r[m].o, sizeof r[m].h);
        const ray same[2] = {r[0], r[0]};
        judge(&t, (const float(*)[3])rgb, &g, allowed(&g, in, f, r, mode == 0), k);
        scale_ray(&r[0], scales[x]);
        const double d_n = r[0].d[0] * f->n[0] + r[0].d[1] * f->n[1] + r[0].d[2] * f->n[2];
        const double rounding = allowed(&g, in, f, same, mode == 0); /* of the two calculations alone */
        if (fabs(d_n) < 1e-14 || rounding < 0) continue;
        if (ilf_eval(other, field, &frames[x], r[0].o, r[0].d, mode == 2 ? NULL : r[0].h,
                     mode ? ILF_NO_DEPTH : ILF_DEPTH, &err) != ILF_OK) {
            fprintf(stderr, "%s\n", err.text);
            return 1;
        }
        t.scaled++;
        int unequal = 0;
        for (int c = 0; c < 3; c++) {
            const double a = (double)rgb[0][c], diff = fabs((double)other[c] - a);
            if (k % KINDS == 0) t.worst_scale = fmax(t.worst_scale, diff / fmax(a, .01 * g.mean));
            unequal |= !(diff <= 1e-4 * fmax(a, .01 * g.mean) + (k % KINDS ? rounding : 0));
        }
        t.unequal += unequal;
    }
    return report(&t);
}

int main(int argc, char **argv)
{
    ilf *field;
    ilf_error err;

    if (argc < 4) return 2;
    if (ilf_open(&field, argv[2], &err) != ILF_OK) {
        fprintf(stderr, "%s\n", err.text);
        return 1;
    }
    const uint64_t seed = strtoull(argv[3], NULL, 10), n = argc > 4 ? strtoull(argv[4], NULL, 10) : 0;
    int code = 2;
    if (!strcmp(argv[1], "rays") && argc == 6) code = give_rays(field, seed, n, atof(argv[5]));
    else if (!strcmp(argv[1], "check") && argc == 6) code = check(field, seed, n, !strcmp(argv[5], "depth"));
    else if (!strcmp(argv[1], "lib") && argc == 5) code = through_lib(field, seed, n);
    else if (!strcmp(argv[1], "plane")) {
        ilf_frame f;
        scaled_frame(&f, ilf_get_frame(field), atof(argv[3]));
        for (int c = 0; c < 3; c++) printf("%.17g ", f.origin[c]);
        for (int c = 0; c < 3; c++) printf("%.17g ", f.u[c] * f.len_u);
        for (int c = 0; c < 3; c++) printf("%.17g%s", f.v[c] * f.len_v, c < 2 ? " " : "\n");
        code = 0;
    }
    ilf_close(field);
    return code;
}
