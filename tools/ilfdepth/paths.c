/*
 * paths.c - sums of costs along paths from eight sides (semi-global matching, Hirschmueller 2008, on a map that closes
 * round the pole's axis).
 */
#include <stdlib.h>
#include <string.h>

#include "sweep.h"

typedef struct penalty {
    float step, jump; /* to a level beside; to any other */
} penalty;

/* to = cost + the least way from `from` (NULL: a path begins). */
static void go_on(float *to, float *sum, const float *cost, const float *from, int levels, penalty p)
{
    float least = 0, now = 1e30f;

    if (from) {
        least = from[0];
        for (int l = 1; l < levels; l++) least = fminf(least, from[l]);
    }
    for (int l = 0; l < levels; l++) {
        float way = 0;
        if (from) {
            way = fminf(from[l], least + p.jump);
            if (l > 0) way = fminf(way, from[l - 1] + p.step);
            if (l + 1 < levels) way = fminf(way, from[l + 1] + p.step);
        }
        to[l] = cost[l] + way - least;
        now = fminf(now, to[l]);
    }
    for (int l = 0; l < levels; l++) sum[l] += to[l];
}

static void along_rows(sweep *w, float *room, int dx, penalty p)
{
    const int W = w->m->w, L = w->p->levels, warm = W / 4;
    float *drop = room + 2 * L;

    for (int y = 0; y < w->m->h; y++)
        for (int k = -warm; k < W; k++) {
            const int x = ((dx > 0 ? k : -k) + 2 * W) % W;
            const size_t at = ((size_t)y * (size_t)W + (size_t)x) * (size_t)L;
            float *to = room + (k & 1) * L, *from = room + (~k & 1) * L;
            go_on(to, k < 0 ? drop : w->sum + at, w->cost + at, k > -warm ? from : NULL, L, p);
        }
}

static void along_columns(sweep *w, float *room, int dx, int dy, penalty p)
{
    const int W = w->m->w, H = w->m->h, L = w->p->levels;

    for (int k = 0; k < H; k++) {
        const int y = dy > 0 ? k : H - 1 - k;
        float *now = room + (size_t)(k & 1) * (size_t)W * (size_t)L,
              *last = room + (size_t)(~k & 1) * (size_t)W * (size_t)L;
        for (int x = 0; x < W; x++) {
            const size_t at = ((size_t)y * (size_t)W + (size_t)x) * (size_t)L;
            const float *from = k ? last + (size_t)((x - dx + W) % W) * (size_t)L : NULL;
            go_on(now + (size_t)x * (size_t)L, w->sum + at, w->cost + at, from, L, p);
        }
    }
}

int paths_sum(sweep *w, errmsg *e)
{
    const penalty p = {2 * w->noise, 10 * w->noise};
    const size_t cells = (size_t)w->m->w * (size_t)w->m->h, row = (size_t)w->m->w * (size_t)w->p->levels;
    float *room = malloc(2 * row * sizeof *room);

    if (!room) return err_set(e, "no memory for a sweep");
    memset(w->sum, 0, cells * (size_t)w->p->levels * sizeof *w->sum);
    along_rows(w, room, 1, p), along_rows(w, room, -1, p);
    for (int dx = -1; dx <= 1; dx++) along_columns(w, room, dx, 1, p), along_columns(w, room, dx, -1, p);
    free(room);
    return 0;
}
