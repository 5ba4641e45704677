/*
 * ghost.c - which exposures of a pixel contradict the others (something moved).
 *
 * Each usable sample says x = y/t give or take its own sigma.  The radiance that most exposures agree
 * on is the one kept; among equal numbers the one with more information.  A sample
 * that lies more than `far` of the joint sigma, and a few per cent, from it is rejected.
 */
#include <math.h>

#include "merge_internal.h"

enum { MOST = 64 };

static const float far = 4; /* sigmas */

typedef struct voice {
    int k;
    float x, sd, info; /* radiance, its relative sigma, information on ln x */
} voice;

static int agree(const voice *a, const voice *b, float tolerance)
{
    float ratio = a->x > b->x ? a->x / b->x - 1 : b->x / a->x - 1;
    return ratio < tolerance + far * sqrtf(a->sd * a->sd + b->sd * b->sd);
}

void merge_find_ghosts(const merge *m, int channel, const merge_row *row, uint64_t *reject)
{
    const merge_channel *ch = &m->ch[channel];
    const int base = (OCTAVES - grid_top_octave) * GRID;
    for (int i = 0; i < row->count; i++) {
        voice v[MOST];
        int voices = 0, best = -1, most = 0;
        float strength = 0;
        size_t at = (size_t)i * row->stride;
        for (int s = 0; s < m->n && voices < MOST; s++) {
            int k = m->order[s];
            const codeval *c = &ch->code[row->codes[k][at]];
            float y = c->y - (row->pedestal ? row->pedestal[at] : 0);
            int gone = row->missing && row->missing[k] && row->missing[k][(size_t)i * row->missing_stride];
            /* near the top a sample may be clipped, which contradicts nothing, and the merge knows */
            if (k >= MOST || gone || !(c->w > 0) || !(y > 0) || row->codes[k][at] > ch->safe) continue;
            const expectation *e = &ch->expect[clamp_cell(cell_of(y) + base)];
            if (!(e->info > 4)) /* a sample known to worse than a factor of 1.5 contradicts nothing */
                continue;
            v[voices++] = (voice){k, y * m->rt[s], e->sd, e->info};
        }
        for (int a = 0; a < voices; a++) {
            int count = 0;
            float info = 0;
            for (int b = 0; b < voices; b++)
                if (agree(&v[a], &v[b], m->tolerance)) {
                    count++;
                    info += v[b].info;
                }
            if (count > most || (count == most && info > strength)) {
                most = count;
                strength = info;
                best = a;
            }
        }
        for (int b = 0; b < voices; b++)
            if (!agree(&v[best], &v[b], m->tolerance)) reject[i] |= (uint64_t)1 << v[b].k;
    }
}

void merge_settle_ghosts(const merge *m, uint64_t *reject, uint64_t *scratch, int count)
{
    uint64_t all = m->n < MOST ? ((uint64_t)1 << m->n) - 1 : ~(uint64_t)0;
    for (int i = 0; i < count; i++) {
        uint64_t left = i > 0 ? reject[i - 1] : 0, right = i + 1 < count ? reject[i + 1] : 0;
        uint64_t wide = reject[i] | left | right;
        scratch[i] = (wide & all) != all ? wide : reject[i];
    }
    for (int i = 0; i < count; i++) reject[i] = scratch[i];
}

void merge_set_tolerance(merge *m, double relative)
{
    m->tolerance = (float)relative;
}

static int clamp(int i, int n)
{
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

/* v = AND (all = 1) or OR over the square of +-reach about each pixel, by rows and then by columns. */
static void square(uint64_t *v, uint64_t *room, int width, int rows, int reach, int all)
{
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < width; x++) {
            uint64_t sum = all ? ~(uint64_t)0 : 0;
            for (int d = -reach; d <= reach; d++) {
                uint64_t w = v[(size_t)y * (size_t)width + (size_t)clamp(x + d, width)];
                sum = all ? sum & w : sum | w;
            }
            room[(size_t)y * (size_t)width + (size_t)x] = sum;
        }
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < width; x++) {
            uint64_t sum = all ? ~(uint64_t)0 : 0;
            for (int d = -reach; d <= reach; d++) {
                uint64_t w = room[(size_t)clamp(y + d, rows) * (size_t)width + (size_t)x];
                sum = all ? sum & w : sum | w;
            }
            v[(size_t)y * (size_t)width + (size_t)x] = sum;
        }
}

void merge_gather_ghosts(const merge *m, uint64_t *votes, uint64_t *room, int width, int rows)
{
    enum { HALF_SIDE = 2, SPREAD = 3 };
    uint64_t all = m->n < MOST ? ((uint64_t)1 << m->n) - 1 : ~(uint64_t)0;
    square(votes, room, width, rows, HALF_SIDE, 1);
    square(votes, room, width, rows, HALF_SIDE + SPREAD, 0);
    for (size_t i = 0; i < (size_t)width * (size_t)rows; i++)
        votes[i] = (votes[i] & all) == all ? 0 : votes[i] & all; /* no one is left to say what is right */
}
