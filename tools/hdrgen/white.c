/*
 * white.c - see white.h.
 *
 * Two piles are looked for in each channel, over pairs of exposures k < l that are neighbours in time with
 * t_l >= 1.15 t_k:
 *   - pixels with all but the same code in both (any light that is not clipped is a code or more brighter
 * in l);
 *   - where there are few of those (one exposure clips at all): pixels with the same code in l, and
 * nothing above it,
 *     whose codes in k differ.
 * White is the lower end of the pile: codecs blur it over a few codes.
 */
#include "white.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LEAST = 24, BINS = 256 };

static const double longer = 1.15;
static const double part_of_peak =
    0.15; /* bins with fewer than this of the fullest one's don't belong to the pile */
static const double stray = 0.02;  /* part of the pile that may lie below white, or above it */
static const double differ = 0.06; /* of the scale: by this much the shorter exposure's codes differ */

typedef struct pile {
    int *count; /* [max_code + 1] */
    int highest, total;
} pile;

static int highest_code(const samples *s, int c)
{
    int highest = 0;
    for (size_t i = 0; i < (size_t)s->n[c] * (size_t)s->exposures; i++)
        highest = s->z[c][i] > highest ? s->z[c][i] : highest;
    return highest;
}

static int bin_of(const pile *p, int z)
{
    return p->highest < BINS ? z : (int)((double)z * (BINS - 1) / p->highest);
}

/* The pile's lower end; 0: there is no pile. */
static int lower_end(const pile *p)
{
    int in[BINS] = {0}, peak = 0;
    for (int z = 0; z <= p->highest; z++) in[bin_of(p, z)] += p->count[z];
    for (int b = 0; b < BINS; b++) peak = in[b] > in[peak] ? b : peak;
    int low = peak, high = peak, members = 0, below = 0, z = 0;
    while (low > 0 && in[low - 1] > part_of_peak * in[peak]) low--;
    while (high < BINS - 1 && in[high + 1] > part_of_peak * in[peak]) high++;
    for (int b = low; b <= high; b++) members += in[b];
    if (members < LEAST || members < p->total / 3) return 0;
    while (bin_of(p, z) < low) z++;
    for (; z < p->highest && below + p->count[z] <= stray * members; z++) below += p->count[z];
    return z;
}

/* The exposure before l that is the longest of those shorter by enough; -1: none. */
static int shorter_than(const double *exposure, int l)
{
    int k = l - 1;
    while (k >= 0 && exposure[l] < longer * exposure[k]) k--;
    return k;
}

static int same_in_both(pile *p, const samples *s, int c, const double *exposure)
{
    int kk = s->exposures, near = (int)ceil(3.0 / 255 * p->highest);
    for (int l = 1; l < kk; l++) {
        int k = shorter_than(exposure, l);
        for (int i = 0; k >= 0 && i < s->n[c]; i++) {
            const uint16_t *z = s->z[c] + (size_t)i * (size_t)kk;
            if (s->gone[c] && (s->gone[c][(size_t)i * (size_t)kk + (size_t)k] ||
                               s->gone[c][(size_t)i * (size_t)kk + (size_t)l]))
                continue;
            if (2 * z[k] < p->highest || 2 * z[l] < p->highest || abs(z[k] - z[l]) > near) continue;
            p->count[z[k]]++;
            p->count[z[l]]++;
            p->total += 2;
        }
    }
    return p->total >= 2 * LEAST ? lower_end(p) : 0;
}

/* Codes of the shorter exposure, ranked by counting: the code below which `part` of them lie. */
static int rank(const int *count, int n, double part, int total)
{
    int sum = 0, z = 0;
    for (; z < n - 1 && sum + count[z] <= part * total; z++) sum += count[z];
    return z;
}

static int one_in_the_longer(pile *p, int *other, const samples *s, int c, const double *exposure)
{
    int kk = s->exposures, l = kk - 1, k = shorter_than(exposure, l), top = s->max_code + 1;
    if (k < 0) return 0;
    memset(p->count, 0, sizeof *p->count * (size_t)top);
    memset(other, 0, sizeof *other * (size_t)top);
    p->total = 0;
    for (int i = 0; i < s->n[c]; i++) {
        size_t at = (size_t)i * (size_t)kk;
        int z = s->z[c][at + (size_t)l];
        if (2 * z < p->highest || (s->gone[c] && (s->gone[c][at + (size_t)k] || s->gone[c][at + (size_t)l])))
            continue;
        p->count[z]++;
        p->total++;
    }
    int white = p->total >= LEAST ? lower_end(p) : 0, members = 0, above = 0;
    if (!white) return 0;
    int near = white + (int)ceil(2.0 / 255 * p->highest);
    for (int i = 0; i < s->n[c]; i++) {
        size_t at = (size_t)i * (size_t)kk;
        int z = s->z[c][at + (size_t)l];
        if (z < white || (s->gone[c] && (s->gone[c][at + (size_t)k] || s->gone[c][at + (size_t)l]))) continue;
        above += z > near;
        other[s->z[c][at + (size_t)k]]++;
        members++;
    }
    int spread = rank(other, top, 0.9, members) - rank(other, top, 0.1, members);
    return members >= LEAST && above <= stray * members && spread > differ * p->highest ? white : 0;
}

/* A channel in which too little is clipped to tell, and that has no code above the others' white, has
 * theirs. */
static void share(int clip[RESPONSE_MAX_CHANNELS], const samples *s)
{
    int found = 0;
    for (int c = 0; c < s->channels; c++)
        if (clip[c] < s->max_code && clip[c] > found) found = clip[c];
    for (int c = 0; c < s->channels; c++)
        if (found && clip[c] == s->max_code && highest_code(s, c) <= found + s->max_code / 255)
            clip[c] = found;
}

int white_find(int clip[RESPONSE_MAX_CHANNELS], const samples *s, const double *exposure, errmsg *e)
{
    size_t codes = (size_t)s->max_code + 1;
    pile p = {.count = malloc(codes * sizeof *p.count)};
    int *other = malloc(codes * sizeof *other), code = -1;
    if (!p.count || !other) {
        err_set(e, "out of memory");
        goto done;
    }
    for (int c = 0; c < s->channels; c++) {
        memset(p.count, 0, codes * sizeof *p.count);
        p.total = 0;
        p.highest = highest_code(s, c);
        int white = p.highest > 3 ? same_in_both(&p, s, c, exposure) : 0;
        if (!white && p.highest > 3) white = one_in_the_longer(&p, other, s, c, exposure);
        clip[c] = white > 3 ? white : s->max_code;
    }
    share(clip, s);
    code = 0;
done:
    free(p.count);
    free(other);
    return code;
}

void white_apply(samples *s, const int clip[RESPONSE_MAX_CHANNELS])
{
    for (int c = 0; c < s->channels; c++) {
        s->clip[c] = clip[c];
        for (size_t i = 0; i < (size_t)s->n[c] * (size_t)s->exposures; i++)
            if (s->z[c][i] >= clip[c]) s->z[c][i] = (uint16_t)s->max_code;
    }
}
