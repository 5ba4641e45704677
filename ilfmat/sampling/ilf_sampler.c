/*
 * ilf_sampler.c - a thread's slices, by cube of space, built when a point first asks.
 */
#include <stdlib.h>

#include "ilf_sampler.h"

/* Slots of the table at first; bytes of slices that are kept. A slice takes some 10 kB for lamps, 900 kB where all directions are
 * bright, and one probe's cubes may be small beside its room. */
enum { TABLE_START = 1 << 10, MOST_BYTES = 512 << 20 };

/* A cube's number as a double is exact up to there. */
#define MOST_CUBES_OFF 1e15

void ilf_sampler_close(ilf_sampler *s)
{
    if (!s) return;
    for (size_t k = 0; s->table && k < s->table_size; k++) free(s->table[k]);
    free(s->table);
    ilf_scratch_free(s->scratch);
    free(s->mark);
    free(s->weight);
    free(s->near);
    free(s->far);
    free(s->seen);
    free(s->most);
    free(s->marked);
    free(s->touched);
    free(s);
}

static int make_scratch(ilf_sampler *s)
{
    s->table_size = TABLE_START;
    s->table = calloc(s->table_size, sizeof *s->table);
    s->mark = calloc(MARK_CELLS, sizeof *s->mark);
    s->marked = malloc(MARK_CELLS * sizeof *s->marked);
    s->weight = calloc(SLICE_CELLS, sizeof *s->weight);
    s->near = calloc(SLICE_CELLS, sizeof *s->near);
    s->far = calloc(SLICE_CELLS, sizeof *s->far);
    s->seen = calloc(SLICE_CELLS, sizeof *s->seen);
    s->most = calloc(SLICE_CELLS, sizeof *s->most);
    s->touched = malloc(SLICE_CELLS * sizeof *s->touched);
    return s->table && s->mark && s->marked && s->weight && s->near && s->far && s->seen && s->most &&
                   s->touched
               ? 0
               : -1;
}

ilf_status ilf_sampler_open(ilf_sampler **sampler, const ilf_patches *patches, ilf_error *err)
{
    ilf_sampler *s = calloc(1, sizeof *s);

    if (!s || make_scratch(s) != 0) {
        ilf_sampler_close(s);
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for sampling", patches->field->path);
    }
    s->of = patches;
    *sampler = s;
    return ILF_OK;
}

void ilf_sampler_work(ilf_work *work, const ilf_sampler *s)
{
    *work = s->work;
}

/* ---- finding a slice ------------------------------------------------------------------------ */

static size_t hash(const int64_t key[3])
{
    uint64_t h = (uint64_t)key[0] * 0x9e3779b97f4a7c15u ^ (uint64_t)key[1] * 0xc2b2ae3d27d4eb4fu ^
                 (uint64_t)key[2] * 0x165667b19e3779f9u;

    h ^= h >> 29;
    h *= 0xbf58476d1ce4e5b9u;
    return (size_t)(h ^ h >> 32);
}

static size_t find(ilf_slice *const *table, size_t size, const int64_t key[3])
{
    size_t k = hash(key) & (size - 1);

    while (table[k] && memcmp(table[k]->key, key, sizeof table[k]->key) != 0) k = (k + 1) & (size - 1);
    return k;
}

/* Keep the table at most half full; where slices have become too many, begin anew. */
static int make_room(ilf_sampler *s)
{
    if (s->bytes >= MOST_BYTES && !s->busy) {
        for (size_t k = 0; k < s->table_size; k++) free(s->table[k]);
        memset(s->table, 0, s->table_size * sizeof *s->table);
        s->used = s->bytes = 0;
        return 0;
    }
    if (2 * s->used < s->table_size) return 0;
    const size_t size = 2 * s->table_size;
    ilf_slice **t = calloc(size, sizeof *t);
    if (!t) return -1;
    for (size_t k = 0; k < s->table_size; k++)
        if (s->table[k]) t[find(t, size, s->table[k]->key)] = s->table[k];
    free(s->table);
    s->table = t;
    s->table_size = size;
    return 0;
}

ilf_status ilf_sampler_cube(ilf_slice **slice, ilf_sampler *s, const double point[3], ilf_error *err)
{
    const ilf_frame *fr = &s->of->frame;
    int64_t key[3];

    for (int c = 0; c < 3; c++) {
        const double *axis = c == 0 ? fr->u : c == 1 ? fr->v : fr->n;
        const double x = (point[0] - fr->origin[0]) * axis[0] + (point[1] - fr->origin[1]) * axis[1] +
                         (point[2] - fr->origin[2]) * axis[2];
        const double q = floor(x / s->of->cube);
        if (!(fabs(q) < MOST_CUBES_OFF))
            return ilf_fail(err, ILF_ERR_ARG, "point: expected finite coordinates near the light field");
        key[c] = (int64_t)q;
    }
    size_t k = find(s->table, s->table_size, key);
    if (!s->table[k]) {
        if (make_room(s) != 0)
            return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for a slice", s->of->field->path);
        k = find(s->table, s->table_size, key);
        const ilf_status st = ilf_build_slice(&s->table[k], s, key, err);
        if (st != ILF_OK) return st;
        s->used++, s->bytes += ilf_slice_bytes(s->of, (size_t)s->table[k]->cells);
    }
    *slice = s->table[k];
    return ILF_OK;
}

ilf_status ilf_sampler_slice(ilf_slice **slice, ilf_sampler *s, const double point[3], ilf_error *err)
{
    ilf_slice *sl = NULL;
    const ilf_status st = s->of->n ? ilf_sampler_cube(&sl, s, point, err) : ILF_OK;

    *slice = st == ILF_OK && sl && sl->cells ? sl : NULL;
    return st;
}
