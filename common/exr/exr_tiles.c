/* exr_tiles.c - see exr_tiles.h. */
#include "exr_tiles.h"

#include <stdlib.h>

#include "exr_bytes.h"
#include "exr_header.h"

/* [part,] x, y, level x, level y, size */
exr_tile exr_tile_head(const unsigned char *head, int several)
{
    exr_tile t = {0};

    if (several) {
        t.part = exr_u32(head);
        head += 4;
    }
    t.x = exr_u32(head), t.y = exr_u32(head + 4), t.size = exr_u32(head + 16);
    return t;
}

/* 0 where the headers don't end. */
static uint64_t table_of(exr_walk *w, int fd, uint64_t file_bytes)
{
    exr_step s;

    if (exr_walk_begin(w, fd, file_bytes) != 0) return 0;
    do s = exr_walk_next(w);
    while (s == EXR_STEP_VALUE || s == EXR_STEP_PART);
    return s == EXR_STEP_END ? w->at : 0;
}

/* Is the tile that begins at `at` as long as it says? */
static int tile_whole(const exr_walk *w, uint64_t at)
{
    const size_t bytes = w->several ? EXR_TILE_HEAD_SEVERAL : EXR_TILE_HEAD;
    unsigned char head[EXR_TILE_HEAD_SEVERAL];

    return w->end - at >= bytes && exr_bytes_at(w->fd, head, bytes, at) == 0 &&
           exr_tile_head(head, w->several).size <= w->end - at - bytes;
}

exr_tiles exr_tiles_check(int64_t *which, int fd, uint64_t file_bytes, int64_t n)
{
    exr_walk w;
    const uint64_t table = table_of(&w, fd, file_bytes), first = table + (uint64_t)n * 8;
    uint64_t last = 0;
    exr_tiles state = EXR_TILES_SOUND;

    if (table == 0 || table > file_bytes || (uint64_t)n > (file_bytes - table) / 8) return EXR_TILES_NO_TABLE;
    unsigned char *t = malloc((size_t)n * 8);
    if (!t) return EXR_TILES_NO_MEMORY;
    if (exr_bytes_at(fd, t, (size_t)n * 8, table) != 0) state = EXR_TILES_UNREADABLE;
    for (int64_t k = 0; k < n && state == EXR_TILES_SOUND; k++) {
        const uint64_t at = exr_u64(t + 8 * k);
        if (at < first || at >= file_bytes) {
            *which = k;
            state = at == 0 ? EXR_TILES_UNFINISHED : EXR_TILES_OUTSIDE;
        }
        if (at > last) last = at;
    }
    free(t);
    return state == EXR_TILES_SOUND && !tile_whole(&w, last) ? EXR_TILES_CUT : state;
}
