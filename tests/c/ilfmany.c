/*
 * ilfmany.c - test driver: ilf_eval_many against a loop over ilf_eval.  ilfmany FILE N
 *
 * N random rays, of which some meet no geometry, in both modes; their radiance by 1, 2 and 5 threads must be the
 * loop's bit by bit, and a ray that fails must be named whoever meets it first.  Prints the CPU nanoseconds per ray
 * of the loop and of one thread.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "ilf.h"
#include "uniform.h"

static const int threads[] = {1, 2, 5};

static void fail(const char *words)
{
    fprintf(stderr, "ilfmany: %s\n", words);
    exit(1);
}

static void *memory(size_t bytes)
{
    void *p = malloc(bytes);
    if (!p) fail("no memory");
    return p;
}

/* Ray k: origin, direction, hit (9 numbers); every fifth meets nothing. */
static void make_ray(double r[9], size_t k, const ilf_frame *f)
{
    const double q[3] = {1.4 * uniform() - .2, 1.4 * uniform() - .2, uniform() - .3};
    const double a[3] = {uniform() - .5, uniform() - .5, uniform() - .1};
    const double far = (1 + 3 * uniform()) * f->len_u;

    for (int c = 0; c < 3; c++) {
        r[c] =
            f->origin[c] + q[0] * f->len_u * f->u[c] + q[1] * f->len_v * f->v[c] + q[2] * f->len_u * f->n[c];
        r[3 + c] = a[0] * f->u[c] + a[1] * f->v[c] + a[2] * f->n[c];
        r[6 + c] = k % 5 ? r[c] + far * r[3 + c] : HUGE_VAL;
    }
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void by_loop(float *rgb, const ilf *field, const double *ray, size_t n, ilf_mode mode)
{
    ilf_error err;

    for (size_t k = 0; k < n; k++) {
        const double *r = ray + 9 * k;
        if (ilf_eval(rgb + 3 * k, field, ilf_get_frame(field), r, r + 3, k % 5 ? r + 6 : NULL, mode, &err) !=
            ILF_OK)
            fail(err.text);
    }
}

/* Both ways, compared; the least times of three go to ns[2]. */
static void compare(double ns[2], const ilf *field, const double *ray, size_t n, ilf_mode mode)
{
    const ilf_rays rays = {n, ray, ray + 3, ray + 6, 9, 9, 9};
    float *loop = memory(n * 3 * sizeof *loop), *many = memory(n * 3 * sizeof *many);
    ilf_error err;

    ns[0] = ns[1] = HUGE_VAL;
    for (int round = 0; round < 3; round++) {
        double start = seconds();
        by_loop(loop, field, ray, n, mode);
        ns[0] = fmin(ns[0], (seconds() - start) / (double)n * 1e9);
        for (int t = 0; t < 3; t++) {
            start = seconds();
            if (ilf_eval_many(many, field, ilf_get_frame(field), &rays, mode, threads[t], &err) != ILF_OK)
                fail(err.text);
            if (t == 0) ns[1] = fmin(ns[1], (seconds() - start) / (double)n * 1e9);
            if (memcmp(loop, many, n * 3 * sizeof *loop) != 0)
                fail("threads give other radiance than the loop");
        }
    }
    free(loop);
    free(many);
}

/* Of two rays without a direction the first is named. */
static void refuse(const ilf *field, double *ray, size_t n)
{
    const ilf_rays rays = {n, ray, ray + 3, NULL, 9, 9, 0};
    float *many = memory(n * 3 * sizeof *many);
    char words[64];
    ilf_error err;

    memset(ray + 9 * (n / 2) + 3, 0, 3 * sizeof *ray);
    memset(ray + 9 * (n - 1) + 3, 0, 3 * sizeof *ray);
    (void)snprintf(words, sizeof words, "ray %zu: expected a direction that is not zero", n / 2);
    for (int t = 0; t < 3; t++)
        if (ilf_eval_many(many, field, ilf_get_frame(field), &rays, ILF_DEPTH, threads[t], &err) !=
                ILF_ERR_ARG ||
            strcmp(err.text, words) != 0)
            fail("the first ray that fails is not named");
    free(many);
}

/* With hardly any memory for decoded probes, rays in another order: what each sees is the same. */
static void bounded(const char *path, const double *ray, size_t n)
{
    const ilf_rays rays = {n, ray, ray + 3, ray + 6, 9, 9, 9};
    float *all = memory(n * 3 * sizeof *all), *few = memory(n * 3 * sizeof *few);
    ilf_error err;
    ilf_usage use;
    ilf *whole, *field;

    if (ilf_open(&whole, path, &err) != ILF_OK || ilf_open(&field, path, &err) != ILF_OK ||
        ilf_set_memory(field, 1, &err) != ILF_OK)
        fail(err.text);
    const ilf_info *in = ilf_get_info(field);
    const int64_t each = (int64_t)in->n_theta * in->n_phi * (in->type == ILF_HALF ? 6 : 12);
    for (int mode = 0; mode < 2; mode++) {
        by_loop(all, whole, ray, n, mode ? ILF_DEPTH : ILF_NO_DEPTH);
        for (int t = 0; t < 3; t++)
            if (ilf_eval_many(few, field, ilf_get_frame(field), &rays, mode ? ILF_DEPTH : ILF_NO_DEPTH,
                              threads[t], &err) != ILF_OK)
                fail(err.text);
            else if (memcmp(all, few, n * 3 * sizeof *all) != 0)
                fail("probes that were given back have other radiance");
    }
    ilf_get_usage(&use, field);
    if (use.decoded_bytes > (16 + 5) * each) fail("more probes are kept than were to be");
    if (ilf_set_memory(field, 0, &err) != ILF_ERR_ARG) fail("memory is bounded after lookups");
    ilf_close(field);
    ilf_close(whole);
    free(all);
    free(few);
}

int main(int argc, char **argv)
{
    const size_t n = argc == 3 ? strtoul(argv[2], NULL, 10) : 0;
    ilf_error err;
    ilf *field;

    if (n < 4) fail("expected a light field and a number of rays, 4 or more");
    if (ilf_open(&field, argv[1], &err) != ILF_OK) fail(err.text);
    double *ray = memory(n * 9 * sizeof *ray);
    for (size_t k = 0; k < n; k++) make_ray(ray + 9 * k, k, ilf_get_frame(field));
    for (int mode = 0; mode < 2; mode++) {
        double ns[2];
        compare(ns, field, ray, n, mode ? ILF_DEPTH : ILF_NO_DEPTH);
        printf("%s loop %.1f many %.1f\n", mode ? "depth" : "nodepth", ns[0], ns[1]);
    }
    bounded(argv[1], ray, n < 4000 ? n : 4000);
    refuse(field, ray, n);
    free(ray);
    ilf_close(field);
    return 0;
}
