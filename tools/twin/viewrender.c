/*
 * viewrender.c - rays through the lens to an rtrace process and the values back.
 *
 * A thread writes the rays (six doubles each) while the caller reads the values (three floats): both
 * walk the same list of pixels and subsamples, so that nothing but the sums is held.
 */
#include "viewrender.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <spawn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "develop.h"

extern char **environ;

/* One run of rtrace: pixel list and K x K subsamples each. */
typedef struct pass {
    const fisheye *f;
    const camera_frame *c;
    const size_t *pixel; /* NULL: all */
    size_t n;
    int k;
    int fd;     /* write end */
    int broken; /* writer: pipe closed before the end */
} pass;

typedef struct brightness {
    float lo, hi;
} brightness;

/* Subsample (a, b) of a pixel as a ray: jittered within its cell, the same each time it is asked. */
static int ray_of(double ray[6], const pass *p, size_t at, int a, int b)
{
    size_t n = (size_t)p->f->size;
    counter_rng r = {0x5eed + (uint64_t)p->k, ((uint64_t)at << 20) + (uint64_t)((a * p->k + b) * 2)};
    double x = (double)(at % n) + (a + rng_uniform(&r)) / p->k;
    double y = (double)(at / n) + (b + rng_uniform(&r)) / p->k;
    memcpy(ray, p->c->pos, 3 * sizeof *ray);
    return fisheye_direction(ray + 3, NULL, p->f, p->c, x, y);
}

static int put(int fd, const void *data, size_t n)
{
    const char *p = data;
    while (n > 0) {
        ssize_t w = write(fd, p, n);
        if (w < 0 && errno == EINTR) continue;
        if (w < 0) return -1;
        p += w;
        n -= (size_t)w;
    }
    return 0;
}

static void *writer(void *arg)
{
    pass *p = arg;
    double buf[512][6];
    size_t held = 0;
    for (size_t i = 0; i < p->n && !p->broken; i++) {
        size_t at = p->pixel ? p->pixel[i] : i;
        for (int b = 0; b < p->k; b++)
            for (int a = 0; a < p->k; a++) {
                held += (size_t)ray_of(buf[held], p, at, a, b);
                if (held < 512) continue;
                if (put(p->fd, buf, sizeof buf) != 0) p->broken = 1;
                held = 0;
            }
    }
    if (held && !p->broken && put(p->fd, buf, held * sizeof buf[0]) != 0) p->broken = 1;
    close(p->fd);
    return NULL;
}

/* Sums the values of a pass into radiance (means) and, where asked, each pixel's range. */
static int collect(float *radiance, brightness *range, const pass *p, FILE *in, errmsg *e)
{
    for (size_t i = 0; i < p->n; i++) {
        size_t at = p->pixel ? p->pixel[i] : i;
        double sum[3] = {0}, ray[6], total = (double)p->k * p->k;
        brightness g = {INFINITY, 0};
        for (int b = 0; b < p->k; b++)
            for (int a = 0; a < p->k; a++) {
                float v[3] = {0};
                if (ray_of(ray, p, at, a, b) && fread(v, sizeof v, 1, in) != 1)
                    return err_set(e, "rtrace: expected a value for every ray, found the end");
                for (int c = 0; c < 3; c++) {
                    if (!isfinite(v[c]) || v[c] < 0)
                        return err_set(e, "rtrace: expected radiance of 0 or more at pixel %zu,%zu, found %g",
                                       at % (size_t)p->f->size, at / (size_t)p->f->size, (double)v[c]);
                    sum[c] += (double)v[c];
                }
                float lum = 0.265f * v[0] + 0.670f * v[1] + 0.065f * v[2];
                g.lo = fminf(g.lo, lum);
                g.hi = fmaxf(g.hi, lum);
            }
        for (int c = 0; c < 3; c++) radiance[at * 3 + (size_t)c] = (float)(sum[c] / total);
        if (range) range[at] = g;
    }
    return 0;
}

/* Last line that rtrace wrote to its error output. */
static void last_words(char out[256], FILE *f)
{
    char line[256];
    out[0] = 0;
    rewind(f);
    while (fgets(line, sizeof line, f)) {
        line[strcspn(line, "\n")] = 0;
        if (line[0]) memcpy(out, line, sizeof line);
    }
}

static int start(pid_t *pid, const view_settings *s, const int in[2], const int out[2], FILE *errors,
                 errmsg *e)
{
    char procs[16];
    int n = 0, rc;
    const char **argv = calloc((size_t)s->options->n + 10, sizeof *argv);
    if (!argv) return err_set(e, "out of memory");
    snprintf(procs, sizeof procs, "%d", s->processes);
    argv[n++] = s->rtrace;
    for (int i = 0; i < s->options->n; i++) argv[n++] = s->options->word[i];
    argv[n++] = "-h";
    argv[n++] = "-fdf";
    argv[n++] = "-ov";
    if (s->processes > 1) {
        argv[n++] = "-n";
        argv[n++] = procs;
    }
    argv[n++] = s->octree;
    posix_spawn_file_actions_t fa;
    posix_spawn_file_actions_init(&fa);
    posix_spawn_file_actions_adddup2(&fa, in[0], 0);
    posix_spawn_file_actions_adddup2(&fa, out[1], 1);
    posix_spawn_file_actions_adddup2(&fa, fileno(errors), 2);
    for (int i = 0; i < 2; i++) {
        posix_spawn_file_actions_addclose(&fa, in[i]);
        posix_spawn_file_actions_addclose(&fa, out[i]);
    }
    rc = posix_spawnp(pid, s->rtrace, &fa, NULL, (char *const *)argv, environ);
    posix_spawn_file_actions_destroy(&fa);
    free(argv);
    if (rc != 0) {
        errno = rc;
        return err_errno(e, "%s", s->rtrace);
    }
    return 0;
}

static int run_pass(float *radiance, brightness *range, pass *p, const view_settings *s, errmsg *e)
{
    int in[2] = {-1, -1}, out[2] = {-1, -1}, bad = 0, status = 0;
    pid_t pid = -1;
    pthread_t thread;
    char words[256] = "";
    FILE *errors = tmpfile();
    if (!errors || pipe(in) != 0 || pipe(out) != 0) bad = err_errno(e, "%s", s->rtrace);
    if (!bad) bad = start(&pid, s, in, out, errors, e);
    if (in[0] >= 0) close(in[0]);
    if (out[1] >= 0) close(out[1]);
    FILE *from = NULL;
    if (!bad) {
        p->fd = in[1];
        in[1] = -1;
        p->broken = 0;
        from = fdopen(out[0], "rb");
        out[0] = -1;
        if (!from || pthread_create(&thread, NULL, writer, p) != 0) {
            close(p->fd);
            bad = err_set(e, "out of memory");
        } else {
            bad = collect(radiance, range, p, from, e);
            fclose(from); /* a failed reader breaks the writer's pipe through rtrace's end */
            from = NULL;
            pthread_join(thread, NULL);
        }
    }
    if (from) fclose(from);
    if (in[1] >= 0) close(in[1]);
    if (out[0] >= 0) close(out[0]);
    if (pid > 0) {
        while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
        }
        last_words(words, errors);
        if (status != 0 || (bad && words[0]))
            bad = err_set(e, "%s: %s", s->octree, words[0] ? words : "rtrace failed without words");
    }
    if (errors) fclose(errors);
    return bad;
}

typedef struct candidate {
    float range;
    size_t at;
} candidate;

static int by_range(const void *a, const void *b)
{
    const candidate *p = a, *q = b;
    if (p->range != q->range) return p->range < q->range ? 1 : -1;
    return (p->at > q->at) - (p->at < q->at);
}

static int by_place(const void *a, const void *b)
{
    size_t p = *(const size_t *)a, q = *(const size_t *)b;
    return (p > q) - (p < q);
}

/* Pixels with more than half the picture's mean luminance between the darkest and the brightest ray
 * of their 3 x 3 neighbourhood; the strongest sixteenth of the picture at most, because a scene that is noise
 * all over gains nothing from more of it.  Returns their number, sorted by place. */
static size_t contrasty(size_t *list, candidate *cand, const brightness *range, const float *radiance,
                        int size)
{
    size_t n = (size_t)size, m = 0, most = n * n / 16 + 1;
    double mean = 0;
    for (size_t i = 0; i < n * n; i++)
        mean += 0.265 * (double)radiance[3 * i] + 0.670 * (double)radiance[3 * i + 1] +
                0.065 * (double)radiance[3 * i + 2];
    mean /= (double)(n * n) * M_PI / 4; /* the circle's share of the square */
    for (int y = 0; y < size; y++)
        for (int x = 0; x < size; x++) {
            brightness g = {INFINITY, 0};
            for (int j = y > 0 ? y - 1 : 0; j <= y + 1 && j < size; j++)
                for (int i = x > 0 ? x - 1 : 0; i <= x + 1 && i < size; i++) {
                    const brightness *b = &range[(size_t)j * n + (size_t)i];
                    g.lo = fminf(g.lo, b->lo);
                    g.hi = fmaxf(g.hi, b->hi);
                }
            if ((double)(g.hi - g.lo) > 0.5 * mean)
                cand[m++] = (candidate){g.hi - g.lo, (size_t)y * n + (size_t)x};
        }
    if (m > most) {
        qsort(cand, m, sizeof *cand, by_range);
        m = most;
    }
    for (size_t i = 0; i < m; i++) list[i] = cand[i].at;
    qsort(list, m, sizeof *list, by_place);
    return m;
}

int view_render(float *radiance, const fisheye *f, const camera_frame *c, const view_settings *s, errmsg *e)
{
    size_t n = (size_t)f->size * (size_t)f->size;
    pass p = {.f = f, .c = c, .n = n, .k = s->supersample};
    brightness *range = calloc(n, sizeof *range);
    candidate *cand = s->refine > s->supersample ? calloc(n, sizeof *cand) : NULL;
    size_t *list = cand ? calloc(n, sizeof *list) : NULL;
    int bad = 0;
    if (!range || (s->refine > s->supersample && (!cand || !list))) bad = err_set(e, "out of memory");
    if (!bad) bad = run_pass(radiance, range, &p, s, e);
    if (!bad && list) {
        p.n = contrasty(list, cand, range, radiance, f->size);
        p.pixel = list;
        p.k = s->refine;
        if (p.n > 0) bad = run_pass(radiance, NULL, &p, s, e);
    }
    free(range);
    free(cand);
    free(list);
    return bad;
}
