/*
 * exr_sizes.h - how large a part's header says that it is.
 */
#ifndef EXR_SIZES_H
#define EXR_SIZES_H

#include <stdint.h>

#include "exr_header.h"

typedef struct exr_sizes {
    int64_t w, h;         /* of the data window */
    uint64_t pixel_bytes; /* of all channels */
    int tiled, deep;
    uint32_t tile_w, tile_h;
    int compression;
    int64_t chunks; /* as stated, 0: not stated */
    int values;     /* of the header, so far */
} exr_sizes;

/* Take what the walk's value says, for a header that exr_header_sound() has seen.  Begin with zeros. */
void exr_sizes_take(exr_sizes *s, const exr_walk *w);

#endif
