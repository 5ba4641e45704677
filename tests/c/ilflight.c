/*
 * ilflight.c - test driver: libilf's estimator on its own, for a host without a renderer.
 *
 *   ilflight FILE [options] <RECORDS >RECORDS
 *
 * A record in is a point and its normal, six doubles.  A record out is 12: for R, G, B the mean of many
 * estimates of the irradiance (or of the integral of a narrow lobe) by the light field's excess that comes
 * straight, the same of their squares; then mean and mean square of what comes by way of a mirror ball, of
 * which glints bring a part and blind rays the rest.
 */
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "ilf.h"
#include "surroundings.h"

#define PI 3.14159265358979323846

enum { IN = 6, OUT = 12 };

static int no_depth, samples = 16, copies = 64, seed = 1, blind = 16, chunk = 1 << 30, nested;
static double threshold, weight = 1, power = 1, rough;
static shape block = {.numbers = 4}, mirror = {.numbers = 4};

static const cli_opt opts[] = {
    {"nodepth", 0, CLI_FLAG, &no_depth, NULL, NULL, "lookups without depth correction"},
    SURROUNDINGS_OPTIONS,
    {"block", 0, CLI_CALL, &block, take_shape, "X,Y,Z,R", "a black ball"},
    {"mirror", 0, CLI_CALL, &mirror, take_shape, "X,Y,Z,R", "a mirror ball"},
    {"rough", 0, CLI_DOUBLE, &rough, NULL, "A", "roughness that libilf takes the mirror ball to have"},
    {"threshold", 0, CLI_DOUBLE, &threshold, NULL, "T",
     "luminance that counts as bright (default: the library's)"},
    {"samples", 0, CLI_INT, &samples, NULL, "N", "rays of a point that counts in full (default 16)"},
    {"weight", 0, CLI_DOUBLE, &weight, NULL, "W", "how much the points count (default 1)"},
    {"power", 0, CLI_DOUBLE, &power, NULL, "P", "the lobe is cos^P of the angle to the normal (default 1)"},
    {"copies", 0, CLI_INT, &copies, NULL, "M", "estimates of a record (default 64)"},
    {"blind", 0, CLI_INT, &blind, NULL, "N",
     "blind rays of an estimate where there is a mirror ball (default 16)"},
    {"seed", 0, CLI_INT, &seed, NULL, "S", "of the random numbers (default 1)"},
    {"chunk", 0, CLI_INT, &chunk, NULL, "N", "records that share a sampler (default: all)"},
    {"nested", 0, CLI_FLAG, &nested, NULL, NULL, "light another point while a ray is traced"},
    {0},
};
static const cli_prog prog = {"ilflight", "FILE", "Estimates of the light of a light field's bright part.",
                              opts,       "",     NULL};

/* A point being lit, and what comes to it. */
typedef struct host {
    const ilf_patches *bright;
    ilf_sampler *sampler;
    uint64_t state;
    const double *x, *n;
    double straight[3], mirrored[3];
    int depth; /* of lighting in lighting */
} host;

static void ok(ilf_status st, const ilf_error *err)
{
    if (st != ILF_OK) cli_fail(CLI_FAILED, "%s", err->text);
}

/* SplitMix64 (Steele, Lea, Flood 2014). */
static double next(host *h)
{
    uint64_t z = h->state += 0x9e3779b97f4a7c15u;

    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static int meets(const shape *s, const double o[3], const double d[3])
{
    const double t = s->there ? cross_sphere(o, d, s->v, -1) : HUGE_VAL;

    return t > 1e-9 && isfinite(t);
}

/* A part of the light field along a ray that meets nothing else; 0 if it is dark. */
static int look(double sum[3], const host *h, ilf_part part, const double o[3], const double d[3],
                double scale)
{
    const int far = !box.there && !sphere.there;
    double hit[3] = {0};
    float rgb[3] = {0};
    ilf_error err;

    if (!far && !way_out(hit, o, d, NULL)) return 0;
    ok(ilf_eval_part(rgb, h->bright, part, o, d, far ? NULL : hit, &err), &err);
    for (int c = 0; c < 3; c++) sum[c] += scale * (double)rgb[c];
    return rgb[0] != 0 || rgb[1] != 0 || rgb[2] != 0;
}

/* The way on from the mirror ball; 0 if something else stands before it, or before the light field. */
static int reflect(double o[3], double d[3], const double x[3], const double dir[3])
{
    const double t = cross_sphere(x, dir, mirror.v, -1);
    double n[3];

    if (meets(&block, x, dir) || !meets(&mirror, x, dir))
        return 0; /* no block behind the ball in our tests */
    for (int c = 0; c < 3; c++) o[c] = x[c] + t * dir[c], n[c] = (o[c] - mirror.v[c]) / mirror.v[3];
    for (int c = 0; c < 3; c++) d[c] = dir[c] - 2 * dot(dir, n) * n[c];
    return !meets(&block, o, d);
}

/* ---- what libilf asks -------------------------------------------------------------------------- */

static double random_number(int dimension, void *context)
{
    (void)dimension;
    return next(context);
}

static double lobe(void *coef, const double dir[3], int lobes, void *context)
{
    const host *h = context;
    const double c = dot(dir, h->n);

    (void)lobes;
    return *(double *)coef = c > 0 ? pow(c, power) : 0;
}

static void light_another(host *h);

static int shadow(const ilf_aim *aim, void *context)
{
    host *h = context;

    if (nested && !h->depth) light_another(h);
    if (meets(&block, h->x, aim->dir) || meets(&mirror, h->x, aim->dir)) return 0;
    return look(h->straight, h, ILF_EXCESS, h->x, aim->dir, *(const double *)aim->coef * aim->scale);
}

static void glint(const ilf_aim *aim, int number, void *context)
{
    host *h = context;
    double o[3], d[3];

    (void)number;
    if (reflect(o, d, h->x, aim->dir))
        look(h->mirrored, h, ILF_EXCESS, o, d, *(const double *)aim->coef * aim->scale);
}

static void light(host *h, int apart)
{
    const ilf_host asks = {random_number,  lobe, shadow, glint, box.there || sphere.there ? way_out : NULL,
                           sizeof(double), h};
    const ilf_point point = {.position = {h->x[0], h->x[1], h->x[2]},
                             .lobes = ILF_DIFFUSE,
                             .glint_lobes = ILF_DIFFUSE,
                             .narrow = power > 10,
                             .apart = apart,
                             .samples = samples,
                             .weight = weight};
    ilf_error err;

    ok(ilf_light(h->sampler, &point, &asks, &err), &err);
}

/* A ray's end is lit in between, in another cube of space. */
static void light_another(host *h)
{
    const double x[3] = {h->x[0] + 0.05, h->x[1] - 0.1, h->x[2] + 0.1};
    host other = {
        .bright = h->bright, .sampler = h->sampler, .state = h->state, .x = x, .n = h->n, .depth = 1};

    light(&other, 1);
}

/* Blind rays of the lobe cos: what those count that see the light field in the ball, beyond its base. */
static void blind_rays(host *h)
{
    const double up[3] = {fabs(h->n[2]) < 0.9 ? 0. : 1., 0., fabs(h->n[2]) < 0.9 ? 1. : 0.};
    const double k = dot(up, h->n);
    double a[3], b[3];

    for (int c = 0; c < 3; c++) a[c] = up[c] - k * h->n[c];
    const double len = sqrt(dot(a, a));
    for (int c = 0; c < 3; c++) a[c] /= len;
    for (int c = 0; c < 3; c++)
        b[c] = h->n[(c + 1) % 3] * a[(c + 2) % 3] - h->n[(c + 2) % 3] * a[(c + 1) % 3];
    for (int j = 0; j < blind; j++) {
        const double s = (j + next(h)) / blind, r = sqrt(s), t = 2 * PI * next(h);
        double dir[3], o[3], d[3];

        for (int c = 0; c < 3; c++) dir[c] = r * cos(t) * a[c] + r * sin(t) * b[c] + sqrt(1 - s) * h->n[c];
        if (!reflect(o, d, h->x, dir)) continue;
        const ilf_way way = {.in_glint = ilf_glint_ball(h->bright, h->x, dir) == 0};
        look(h->mirrored, h, ilf_ray_part(&way) & ILF_EXCESS, o, d, PI / blind);
    }
}

/* ---- records and threads ----------------------------------------------------------------------- */

typedef struct job {
    const ilf_patches *bright;
    const double *in;
    double *out;
    int records, first, step; /* chunks first, first + step, ... are ours */
} job;

static void one_record(host *h, const double *in, double *out, int number)
{
    double sum[OUT] = {0};

    h->x = in;
    h->n = in + 3;
    for (int m = 0; m < copies; m++) {
        h->state =
            ((uint64_t)(unsigned)seed << 48) + ((uint64_t)(unsigned)number << 24) + (uint64_t)(unsigned)m;
        next(h);
        memset(h->straight, 0, sizeof h->straight);
        memset(h->mirrored, 0, sizeof h->mirrored);
        light(h, 0);
        if (mirror.there) blind_rays(h);
        for (int c = 0; c < 3; c++) {
            sum[c] += h->straight[c], sum[3 + c] += h->straight[c] * h->straight[c];
            sum[6 + c] += h->mirrored[c], sum[9 + c] += h->mirrored[c] * h->mirrored[c];
        }
    }
    for (int k = 0; k < OUT; k++) out[k] = sum[k] / copies;
}

static void *work(void *arg)
{
    const job *j = arg;

    for (int at = j->first; at < (j->records - 1) / chunk + 1; at += j->step) {
        host h = {.bright = j->bright};
        ilf_error err;

        ok(ilf_sampler_open(&h.sampler, j->bright, &err), &err);
        for (int k = 0; k < chunk && at * chunk + k < j->records; k++) {
            const int n = at * chunk + k;
            one_record(&h, j->in + IN * n, j->out + OUT * n, n);
        }
        ilf_sampler_close(h.sampler);
    }
    return NULL;
}

static double *read_records(int *n)
{
    double *in = NULL;
    int room = 0;

    *n = 0;
    do {
        if (*n == room) in = realloc(in, (size_t)(room = 2 * room + 64) * IN * sizeof *in);
        if (!in) cli_fail(CLI_FAILED, "no memory");
    } while (fread(in + IN * *n, sizeof *in, IN, stdin) == IN && ++*n);
    return in;
}

int main(int argc, char **argv)
{
    enum { MOST_THREADS = 16 };
    pthread_t threads[MOST_THREADS];
    job jobs[MOST_THREADS];
    ilf_ball shiny;
    ilf_patches_spec spec = {.balls = &shiny};
    ilf_patches *bright;
    ilf_error err;
    ilf *field;
    int n;

    if (cli_parse(&prog, argc, argv) != 1) cli_fail(CLI_USAGE, "expected one light field");
    const int count = cli_threads < 1 ? 1 : cli_threads > MOST_THREADS ? MOST_THREADS : cli_threads;
    double *in = read_records(&n), *out = calloc((size_t)n * OUT + 1, sizeof *out);
    if (!out) cli_fail(CLI_FAILED, "no memory");
    ok(ilf_open(&field, argv[1], &err), &err);
    spec.mode = no_depth ? ILF_NO_DEPTH : ILF_DEPTH;
    spec.hit = box.there || sphere.there ? way_out : NULL;
    spec.threshold = threshold;
    spec.n_balls = mirror.there;
    shiny = (ilf_ball){{mirror.v[0], mirror.v[1], mirror.v[2]}, mirror.v[3], rough};
    ok(ilf_patches_open(&bright, field, ilf_get_frame(field), &spec, &err), &err);
    for (int t = 0; t < count; t++) {
        jobs[t] = (job){bright, in, out, n, t, count};
        if (pthread_create(&threads[t], NULL, work, &jobs[t]) != 0) cli_fail(CLI_FAILED, "no thread");
    }
    for (int t = 0; t < count; t++) pthread_join(threads[t], NULL);
    if (fwrite(out, sizeof *out * OUT, (size_t)n, stdout) != (size_t)n)
        cli_fail(CLI_FAILED, "standard output: cannot write");
    ilf_patches_close(bright);
    ilf_close(field);
    free(in);
    free(out);
    return cli_end(CLI_OK);
}
