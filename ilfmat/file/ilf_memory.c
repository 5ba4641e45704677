/*
 * ilf_memory.c - the memory of decoded probes, where it is bounded: a ring of those that have some, of which the oldest
 * gives its to the next that is decoded.
 *
 * Lookups take no lock and tell nobody what they look at.  So a probe's memory may become another's under one; it notices by
 * the number `given_back`, which counts up before that, and looks again (ilf_eval.c):
 *
 *     gives back                              looks up
 *       pix[k] = NULL                           n = given_back
 *       given_back++                            pix[k], texels ...
 *       texels of another probe ...             given_back is still n?
 *
 * A lookup needs at most four probes and takes a microsecond, to decode one takes thousands: hardly any looks twice.
 * What a wrong look reads are numbers in memory that is there; they are thrown away.
 */
#include <stdlib.h>

#include "ilf_internal.h"

enum { LEAST = 16 }; /* probes: four for each of a few threads */

ilf_status ilf_set_memory(ilf *f, int64_t bytes, ilf_error *err)
{
    const int64_t n = (int64_t)f->info.n_u * f->info.n_v, fit = bytes / (int64_t)f->probe_bytes;
    ilf_status st = ILF_OK;

    pthread_mutex_lock(&f->lock);
    if (bytes < 0 || f->usage.probes)
        st = ilf_fail(err, ILF_ERR_ARG, "%s: memory: expected a number of bytes, before the first lookup",
                      f->path);
    else if (bytes > 0 && !f->memory.order &&
             !(f->memory.order = malloc((size_t)n * sizeof *f->memory.order)))
        st = ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for a list of %lld probes", f->path, (long long)n);
    else f->memory.most = bytes == 0 || fit >= n ? 0 : fit < LEAST ? LEAST : fit;
    pthread_mutex_unlock(&f->lock);
    return st;
}

unsigned char *ilf_memory_take(ilf *f)
{
    probe_memory *m = &f->memory;
    const int64_t all = (int64_t)f->info.n_u * f->info.n_v;

    m->n++;
    while (m->n > m->most && m->count > 0) {
        const int64_t k = m->order[m->first];
        probe *p = &f->probes[k];

        m->first = (m->first + 1) % all, m->count--, m->n--;
        if (p->pinned) continue; /* it keeps its memory, and counts no more */
        unsigned char *texels = p->decoded;
        atomic_store_explicit(&f->pix[k], NULL, memory_order_relaxed);
        atomic_fetch_add_explicit(&m->given_back, 1, memory_order_acq_rel);
        atomic_thread_fence(memory_order_release);
        p->decoded = NULL;
        f->usage.decoded_bytes -= (int64_t)f->probe_bytes;
        return texels;
    }
    return NULL;
}

void ilf_memory_keep(ilf *f, int64_t k)
{
    probe_memory *m = &f->memory;

    if (!m->most) return;
    m->order[(m->first + m->count++) % ((int64_t)f->info.n_u * f->info.n_v)] = k;
}

void ilf_memory_none(ilf *f)
{
    f->memory.n--;
}

void ilf_memory_free(ilf *f)
{
    free(f->memory.order);
}
