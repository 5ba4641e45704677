/*
 * pathtrace.c - a path tracer of spheres and planes in a light field: what a renderer does with ilf.h.
 *
 *   pathtrace FIELD.ilf.exr OUT.exr [SAMPLES [SEED]]
 *
 * The scene is the table below, its surroundings a sphere on which the light field shows.  A path that leaves
 * the scene counts the part of the light that its last turn leaves it (ilf_ray_part); the rest comes to each
 * diffuse point by ilf_light.  The four functions between the rules are all that libilf asks of a host.
 */
#include <math.h>
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ilf.h"

#define PI 3.14159265358979323846

enum { WIDTH = 48, HEIGHT = 36, MOST_DIFFUSE = 2, MOST_TURNS = 40 };

typedef struct thing {
    int is_plane, ball;  /* ball: a mirror's number as libilf counts them, or -1 */
    double rgb[3], v[4]; /* centre and radius, or unit normal and its product with the plane's points */
} thing;

static const thing things[] = {
    {1, -1, {.5, .5, .5}, {0, 0, 1, 0}},
    {0, -1, {.7, .3, .2}, {-.3, .2, .15, .15}},
    {0, -1, {.3, .5, .7}, {.05, .35, .1, .1}},
    {0, 0, {1, 1, 1}, {.1, -.05, .17, .17}},
};
enum { THINGS = sizeof things / sizeof things[0] };
static const ilf_ball mirrors[] = {{{.1, -.05, .17}, .17, 0}};
static const double surroundings[4] = {0, 0, .5, 3.5};
static const double eye[3] = {0, -2.2, 1.1}, look_at[3] = {0, 0, .12}, width_at_1 = .45;

typedef struct path {
    const ilf_patches *bright;
    ilf_sampler *sampler;
    uint64_t state;                 /* of the random numbers */
    double x[3], n[3], albedo[3];   /* the diffuse point that is being lit */
    double throughput[3], value[3]; /* of light that comes to it; what the path has found */
    int paths;                      /* per pixel */
} path;

static void ok(ilf_status st, const ilf_error *err)
{
    if (st == ILF_OK) return;
    fprintf(stderr, "pathtrace: %s\n", err->text);
    exit(1);
}

/* ---- vectors, numbers, things ------------------------------------------------------------------- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(double r[3], const double a[3], const double b[3])
{
    for (int c = 0; c < 3; c++) r[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
}

static void unit(double a[3])
{
    const double len = sqrt(dot(a, a));

    for (int c = 0; c < 3; c++) a[c] /= len;
}

static double number(path *p) /* SplitMix64: Steele, Lea, Flood (2014) */
{
    uint64_t z = p->state += 0x9e3779b97f4a7c15u;

    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

/* How far a ray goes to a sphere, from outside or (out = 1) from inside. */
static double to_sphere(const double v[4], const double o[3], const double d[3], int out)
{
    const double w[3] = {o[0] - v[0], o[1] - v[1], o[2] - v[2]}, b = dot(w, d);
    const double disc = b * b - dot(w, w) + v[3] * v[3];

    return disc < 0 ? HUGE_VAL : out ? sqrt(disc) - b : -sqrt(disc) - b;
}

/* The first thing that a ray meets before the surroundings, where, and its normal; NULL: none. */
static const thing *meet(double x[3], double n[3], const double o[3], const double d[3])
{
    const thing *found = NULL;
    double best = to_sphere(surroundings, o, d, 1);

    for (const thing *t = things; t < things + THINGS; t++) {
        const double at = t->is_plane ? (t->v[3] - dot(t->v, o)) / dot(t->v, d) : to_sphere(t->v, o, d, 0);
        if (at > 1e-9 && at < best) best = at, found = t;
    }
    for (int c = 0; c < 3 && found; c++) {
        x[c] = o[c] + best * d[c];
        n[c] = found->is_plane ? found->v[c] : (x[c] - found->v[c]) / found->v[3];
    }
    return found;
}

static void reflect(double d[3], const double n[3])
{
    const double k = 2 * dot(d, n);

    for (int c = 0; c < 3; c++) d[c] -= k * n[c];
}

/* ---- what libilf asks of us --------------------------------------------------------------------- */

static int find_surroundings(double hit[3], const double o[3], const double d[3], void *context)
{
    const double at = to_sphere(surroundings, o, d, 1);

    (void)context;
    for (int c = 0; c < 3; c++) hit[c] = o[c] + at * d[c];
    return isfinite(at);
}

/* Add a part of the light field as a ray sees it; is there any? */
static int add_light(path *p, ilf_part part, const double o[3], const double d[3], const double *by,
                     double scale)
{
    double hit[3];
    float rgb[3];
    ilf_error err;

    find_surroundings(hit, o, d, NULL);
    ok(ilf_eval_part(rgb, p->bright, part, o, d, hit, &err), &err);
    for (int c = 0; c < 3; c++) p->value[c] += by[c] * scale * (double)rgb[c];
    return rgb[0] != 0 || rgb[1] != 0 || rgb[2] != 0;
}

static double random_number(int dimension, void *context)
{
    (void)dimension;
    return number(context);
}

/* Lambert's, times what the path carries: the factor for what a ray finds.  It counts by its luminance. */
static double lobe(void *coef, const double d[3], int lobes, void *context)
{
    const path *p = context;
    const double cosine = fmax(dot(p->n, d), 0);
    double *f = coef;

    (void)lobes;
    for (int c = 0; c < 3; c++) f[c] = cosine / PI * p->albedo[c] * p->throughput[c];
    return 0.265 * f[0] + 0.670 * f[1] + 0.065 * f[2];
}

static int shadow(const ilf_aim *aim, void *context)
{
    path *p = context;
    double x[3], n[3];

    return !meet(x, n, p->x, aim->dir) && add_light(p, ILF_EXCESS, p->x, aim->dir, aim->coef, aim->scale);
}

static void glint(const ilf_aim *aim, int ball, void *context)
{
    double x[3], y[3], n[3], d[3] = {aim->dir[0], aim->dir[1], aim->dir[2]};
    path *p = context;
    const thing *t = meet(x, n, p->x, d);

    if (!t || t->ball != ball) return;
    reflect(d, n);
    if (!meet(y, n, x, d)) add_light(p, ILF_EXCESS, x, d, aim->coef, aim->scale); /* our mirrors are white */
}

/* ---- paths -------------------------------------------------------------------------------------- */

/* The excess that comes to a diffuse point.  Points that the eye doesn't see count little. */
static void light(path *p, const thing *t, const double x[3], const double n[3], int first)
{
    const ilf_host host = {random_number, lobe, shadow, glint, find_surroundings, 3 * sizeof(double), p};
    const ilf_point point = {.position = {x[0], x[1], x[2]},
                             .lobes = ILF_DIFFUSE,
                             .glint_lobes = ILF_DIFFUSE,
                             .samples = 1,
                             .weight = (first ? 1. : .1) / p->paths};
    ilf_error err;

    memcpy(p->x, x, sizeof p->x);
    memcpy(p->n, n, sizeof p->n);
    memcpy(p->albedo, t->rgb, sizeof p->albedo);
    ok(ilf_light(p->sampler, &point, &host, &err), &err);
}

/* A direction distributed as the cosine to n. */
static void scatter(path *p, double d[3], const double n[3])
{
    const double s = number(p), phi = 2 * PI * number(p), r = sqrt(s);
    const double axis[3] = {fabs(n[0]) < .7, fabs(n[0]) >= .7, 0};
    double u[3], v[3];

    cross(u, axis, n);
    unit(u);
    cross(v, n, u);
    for (int c = 0; c < 3; c++) d[c] = r * cos(phi) * u[c] + r * sin(phi) * v[c] + sqrt(1 - s) * n[c];
}

static void trace(path *p, double o[3], double d[3])
{
    ilf_way way = {0};
    int diffuse = 0;

    for (int turn = 0; turn < MOST_TURNS; turn++) {
        double x[3], n[3];
        const thing *t = meet(x, n, o, d);

        if (!t) {
            add_light(p, ilf_ray_part(&way), o, d, p->throughput, 1);
            return;
        }
        if (t->ball >= 0) {
            way.in_glint = way.scattered && ilf_glint_ball(p->bright, o, d) == t->ball;
            way.scattered = 0;
            reflect(d, n);
        } else {
            if (diffuse++ == MOST_DIFFUSE) return;
            light(p, t, x, n, diffuse == 1);
            scatter(p, d, n);
            way = (ilf_way){.scattered = 1};
        }
        for (int c = 0; c < 3; c++) p->throughput[c] *= t->rgb[c], o[c] = x[c];
    }
}

/* Row by row, R G B. */
static void render(float *rgb, path *p, int seed)
{
    double look[3], right[3], down[3];

    for (int c = 0; c < 3; c++) look[c] = look_at[c] - eye[c];
    unit(look);
    cross(right, look, (const double[3]){0, 0, 1});
    unit(right);
    cross(down, look, right);
    for (int k = 0; k < WIDTH * HEIGHT * p->paths; k++) {
        const int pixel = k / p->paths;
        const double a = (pixel % WIDTH + .5 - .5 * WIDTH) * width_at_1 / WIDTH,
                     b = (pixel / WIDTH + .5 - .5 * HEIGHT) * width_at_1 / WIDTH;
        double o[3], d[3];

        p->state = ((uint64_t)(unsigned)seed << 40) + (uint64_t)(unsigned)k;
        for (int c = 0; c < 3; c++) {
            o[c] = eye[c], d[c] = look[c] + a * right[c] + b * down[c];
            p->throughput[c] = 1, p->value[c] = 0;
        }
        unit(d);
        trace(p, o, d);
        for (int c = 0; c < 3; c++) rgb[3 * pixel + c] += (float)(p->value[c] / p->paths);
    }
}

/* An uncompressed picture: for each row all B, then all G, then all R.  Not 0 where it can't be written. */
static int write_exr(const char *name, const float *rgb)
{
    const char *const channels[] = {"B", "G", "R"};
    float row[3 * WIDTH];
    exr_context_t f;

    if (exr_start_write(&f, name, EXR_WRITE_FILE_DIRECTLY, NULL) != EXR_ERR_SUCCESS) return -1;
    int bad = exr_add_part(f, NULL, EXR_STORAGE_SCANLINE, NULL) ||
              exr_initialize_required_attr_simple(f, 0, WIDTH, HEIGHT, EXR_COMPRESSION_NONE);
    for (int c = 0; c < 3 && !bad; c++)
        bad = exr_add_channel(f, 0, channels[c], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LINEAR, 1, 1);
    bad = bad || exr_write_header(f);
    for (int y = 0; y < HEIGHT && !bad; y++) {
        for (int k = 0; k < 3 * WIDTH; k++) row[k] = rgb[3 * (y * WIDTH + k % WIDTH) + 2 - k / WIDTH];
        bad = exr_write_scanline_chunk(f, 0, y, row, sizeof row);
    }
    return exr_finish(&f) || bad;
}

int main(int argc, char **argv)
{
    static float rgb[3 * WIDTH * HEIGHT];
    const ilf_patches_spec spec = {
        .mode = ILF_DEPTH, .hit = find_surroundings, .cube = .15, .balls = mirrors, .n_balls = 1};
    ilf *field;
    ilf_patches *bright;
    ilf_error err;
    path p = {0};

    if (argc < 3 || argc > 5)
        return fprintf(stderr, "usage: pathtrace FIELD.ilf.exr OUT.exr [SAMPLES [SEED]]\n"), 2;
    ok(ilf_open(&field, argv[1], &err), &err);
    ok(ilf_patches_open(&bright, field, ilf_get_frame(field), &spec, &err), &err);
    ok(ilf_sampler_open(&p.sampler, bright, &err), &err);
    p.bright = bright;
    p.paths = argc > 3 ? atoi(argv[3]) : 64;
    render(rgb, &p, argc > 4 ? atoi(argv[4]) : 1);
    const int bad = write_exr(argv[2], rgb);
    if (bad) fprintf(stderr, "pathtrace: %s: cannot be written\n", argv[2]);
    ilf_sampler_close(p.sampler);
    ilf_patches_close(bright);
    ilf_close(field);
    return bad != 0;
}
