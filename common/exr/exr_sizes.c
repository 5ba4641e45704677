/* exr_sizes.c - see exr_sizes.h. */
#include "exr_sizes.h"

#include "exr_bytes.h"

void exr_sizes_take(exr_sizes *s, const exr_walk *w)
{
    unsigned char v[16] = {0};

    s->values++;
    if (exr_bytes_at(w->fd, v, w->size < sizeof v ? (size_t)w->size : sizeof v, w->value) != 0) return;
    if (strcmp(w->name, "dataWindow") == 0 && w->size == 16) {
        s->w = (int64_t)(int32_t)exr_u32(v + 8) - (int32_t)exr_u32(v) + 1;
        s->h = (int64_t)(int32_t)exr_u32(v + 12) - (int32_t)exr_u32(v + 4) + 1;
    } else if (strcmp(w->name, "compression") == 0 && w->size == 1) {
        s->compression = v[0];
    } else if (strcmp(w->name, "tiles") == 0 && w->size == 9) {
        s->tiled = 1;
        s->tile_w = exr_u32(v);
        s->tile_h = exr_u32(v + 4);
    } else if (strcmp(w->name, "type") == 0) {
        s->deep = memcmp(v, "deep", 4) == 0;
        if (w->size == 13 && memcmp(v, "scanlineimage", 13) == 0) s->tiled = 0;
    } else if (strcmp(w->name, "chunkCount") == 0 && w->size == 4) {
        const int32_t n = (int32_t)exr_u32(v);
        s->chunks = n > 0 ? n : 0;
    } else if (strcmp(w->name, "channels") == 0) {
        s->pixel_bytes = exr_channel_bytes(w);
    }
}
