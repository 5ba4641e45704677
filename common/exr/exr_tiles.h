/*
 * exr_tiles.h - the tiles of an OpenEXR file's first part: their table, and the words before each one's data.
 */
#ifndef EXR_TILES_H
#define EXR_TILES_H

#include <stdint.h>

typedef enum exr_tiles {
    EXR_TILES_SOUND,
    EXR_TILES_NO_TABLE,   /* the file ends before the table does */
    EXR_TILES_UNREADABLE, /* the table */
    EXR_TILES_NO_MEMORY,
    EXR_TILES_UNFINISHED, /* tile *which was never written */
    EXR_TILES_OUTSIDE,    /* tile *which would begin outside the file */
    EXR_TILES_CUT         /* the last tile ends outside the file */
} exr_tiles;

/* Does each of the n tiles begin inside the file, and the one that begins last end there, too? */
exr_tiles exr_tiles_check(int64_t *which, int fd, uint64_t file_bytes, int64_t n);

/* What stands before a tile's data. */
typedef struct exr_tile {
    uint32_t part, x, y, size; /* size: of the data, bytes */
} exr_tile;
enum { EXR_TILE_HEAD = 20, EXR_TILE_HEAD_SEVERAL = 24 }; /* its bytes, in a file of one part or of several */

exr_tile exr_tile_head(const unsigned char *head, int several);

#endif
