/*
 * ilf_ahead.c - all probes of a compressed field decoded by several threads, before one thread looks through them.
 *
 * The threads live as long as the call, and take no signals: those are the host's, whose handlers expect its own thread.
 */
#include <signal.h>

#include "ilf_internal.h"

enum { MOST_THREADS = 64, WORTH = 8 << 20 }; /* bytes: below, threads cost more than they save */

typedef struct ahead {
    const ilf *field;
    int64_t n;
    _Atomic int64_t next;
} ahead;

static void *decode_some(void *shared)
{
    ahead *a = shared;

    for (int64_t k; (k = atomic_fetch_add(&a->next, 1)) < a->n;)
        if (ilf_need_probe(a->field, k, NULL) != ILF_OK) break; /* whoever looks at it is told */
    return NULL;
}

void ilf_read_ahead(const ilf *f)
{
    ahead a = {.field = f, .n = (int64_t)f->info.n_u * f->info.n_v};
    const int64_t each = (int64_t)f->probe_bytes;
    pthread_t others[MOST_THREADS];
    sigset_t all, before;
    int n = 0, threads = ilf_processors();

    if (f->in_place || f->memory.most || a.n < 2 || each < WORTH / a.n) return;
    if (threads > MOST_THREADS) threads = MOST_THREADS;
    if (threads > a.n) threads = (int)a.n;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    while (n < threads - 1 && pthread_create(&others[n], NULL, decode_some, &a) == 0) n++;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    (void)decode_some(&a);
    while (n > 0) pthread_join(others[--n], NULL);
}
