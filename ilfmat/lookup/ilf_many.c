/*
 * ilf_many.c - lookups by the thousand: ilf_eval of an array of rays, shared out to threads.
 *
 * Threads take pieces of the array in ascending order.  So all before a piece that fails were taken, too, and the
 * first ray that fails is the same for any number of threads.  They live as long as the call: to begin one costs
 * about as much as a hundred lookups, and nothing is left for a fork, or the library's end, to trip over.
 */
#include <sched.h>
#include <stdio.h>

#include "ilf_internal.h"

enum { PIECE = 2048, MOST_THREADS = 256 };

/* What the threads of a call share. */
typedef struct job {
    float *rgb;
    const ilf *field;
    const ilf_frame *frame;
    const ilf_rays *rays;
    ilf_mode mode;
    _Atomic size_t next; /* the first ray that nobody has taken */
    atomic_int stop;     /* a ray failed: no further pieces */
    pthread_mutex_t lock;
    size_t failed; /* the first such ray, under lock; rays->n: none */
    ilf_error error;
} job;

/* Where the ray meets the auxiliary geometry, or NULL. */
static const double *hit_of(const ilf_rays *r, size_t k)
{
    const double *h = r->hits ? r->hits + k * r->hit_step : NULL;

    return h && !isinf(h[0]) && !isinf(h[1]) && !isinf(h[2]) ? h : NULL;
}

/* The earliest failure counts; its words say which ray, where they speak of a ray. */
static void note_failure(job *j, size_t k, const ilf_error *e)
{
    static const char ray[] = "ray: ";
    const size_t skip = strncmp(e->text, ray, sizeof ray - 1) == 0 ? sizeof ray - 1 : 0;

    atomic_store(&j->stop, 1);
    pthread_mutex_lock(&j->lock);
    if (k < j->failed) {
        j->failed = k;
        if (skip) (void)ilf_fail(&j->error, e->status, "ray %zu: %s", k, e->text + skip);
        else j->error = *e;
    }
    pthread_mutex_unlock(&j->lock);
}

/* Rays from `from` to before `to`; 0 if one failed. */
static int eval_piece(job *j, size_t from, size_t to)
{
    const ilf_rays *r = j->rays;
    ilf_error e;

    for (size_t k = from; k < to; k++)
        if (ilf_eval(j->rgb + 3 * k, j->field, j->frame, r->origins + k * r->origin_step,
                     r->dirs + k * r->dir_step, hit_of(r, k), j->mode, &e) != ILF_OK) {
            note_failure(j, k, &e);
            return 0;
        }
    return 1;
}

static void *work(void *shared)
{
    job *j = shared;
    const size_t n = j->rays->n;

    while (!atomic_load(&j->stop)) {
        const size_t from = atomic_fetch_add(&j->next, PIECE);
        if (from >= n || !eval_piece(j, from, n - from < PIECE ? n : from + PIECE)) break;
    }
    return NULL;
}

int ilf_processors(void)
{
    cpu_set_t set;

    return sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
}

/* The caller's thread works too; where the system gives no more threads, those that there are do it. */
static void share_out(job *j, int threads)
{
    pthread_t others[MOST_THREADS];
    int n = 0;

    while (n < threads - 1 && pthread_create(&others[n], NULL, work, j) == 0) n++;
    (void)work(j);
    while (n > 0) pthread_join(others[--n], NULL);
}

ilf_status ilf_eval_many(float *rgb, const ilf *field, const ilf_frame *frame, const ilf_rays *rays,
                         ilf_mode mode, int threads, ilf_error *err)
{
    const size_t pieces = rays->n / PIECE + (rays->n % PIECE > 0);
    job j = {.rgb = rgb, .field = field, .frame = frame, .rays = rays, .mode = mode, .failed = rays->n};

    if (threads < 0) return ilf_fail(err, ILF_ERR_ARG, "threads: expected 0 or more, found %d", threads);
    if (threads == 0) threads = ilf_processors();
    if (threads > MOST_THREADS) threads = MOST_THREADS;
    if ((size_t)threads > pieces) threads = (int)pieces;
    if (pthread_mutex_init(&j.lock, NULL) != 0) return ilf_fail(err, ILF_ERR_MEMORY, "no memory for a lock");
    share_out(&j, threads);
    pthread_mutex_destroy(&j.lock);
    if (j.failed == rays->n) return ILF_OK;
    if (err) *err = j.error;
    return j.error.status;
}
