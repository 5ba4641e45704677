/*
 * image_exr_check.c - OpenEXR's library believes a header: it reads values by their types, and takes memory
 * for tables and chunks of the sizes stated.  Here they are held against the size of the file first.
 *
 * A file has one table entry of 8 bytes for each chunk, so that it can't have more chunks than an eighth of
 * its bytes; and no compression makes a chunk thousands of times smaller than it is.
 */
#include <limits.h>

#include "exr/exr_compression.h"
#include "exr/exr_header.h"
#include "exr/exr_sizes.h"
#include "image_exr.h"

enum { SMALL = 64 << 20, SHRINK = 4096 }; /* a chunk beyond SMALL bytes may be SHRINK times the file */

static int check_part(const img_reader *r, const exr_sizes *s, errmsg *e)
{
    char words[128];
    if (exr_foreign_compression(words, sizeof words, s->compression))
        return img_bad(r, e, "compression: expected one that this program reads, %s", words);
    if (img_check_size(r->path, s->w, s->h, e) < 0) return -1;
    int64_t lines = exr_compression_lines(s->compression), chunks = s->chunks,
            fewest = (s->h + lines - 1) / lines;
    uint64_t unit = (uint64_t)s->w * (uint64_t)(lines < s->h ? lines : s->h);
    if (s->tiled) {
        if (s->tile_w < 1 || s->tile_h < 1 || s->tile_w > INT_MAX || s->tile_h > INT_MAX)
            return img_bad(r, e, "broken OpenEXR file: tiles of %ux%u pixels", s->tile_w, s->tile_h);
        fewest = ((s->w + s->tile_w - 1) / s->tile_w) * ((s->h + s->tile_h - 1) / s->tile_h);
        unit = (uint64_t)s->tile_w * s->tile_h;
    }
    if (chunks < fewest) chunks = fewest;
    if (chunks > r->bytes / 8)
        return img_bad(r, e, "broken OpenEXR file: it has %lld bytes, too few for the table of %lld chunks",
                       (long long)r->bytes, (long long)chunks);
    if (s->pixel_bytes == 0) return img_bad(r, e, "broken OpenEXR file: a part without channels");
    if (unit > INT_MAX / s->pixel_bytes)
        return img_bad(r, e, "expected chunks of at most %d bytes, found %llu pixels of %llu bytes", INT_MAX,
                       (unsigned long long)unit, (unsigned long long)s->pixel_bytes);
    if (!s->deep && unit * s->pixel_bytes > SMALL && unit * s->pixel_bytes / SHRINK > (uint64_t)r->bytes)
        return img_bad(r, e, "broken OpenEXR file: it has %lld bytes and chunks of %llu", (long long)r->bytes,
                       (unsigned long long)(unit * s->pixel_bytes));
    return 0;
}

int exr_check(const img_reader *r, errmsg *e)
{
    const int fd = fileno(r->f);
    exr_sizes part = {0};
    exr_walk w;
    if (!exr_header_sound(fd, (uint64_t)r->bytes))
        return img_bad(r, e, "broken OpenEXR file: header whose sizes don't fit");
    if (exr_walk_begin(&w, fd, (uint64_t)r->bytes) != 0) return img_bad(r, e, "can't read");
    for (;;) {
        const exr_step step = exr_walk_next(&w);
        if (step == EXR_STEP_BROKEN) return img_bad(r, e, "broken OpenEXR file: header");
        if (step == EXR_STEP_VALUE) {
            exr_sizes_take(&part, &w);
            continue;
        }
        if (w.several && part.values == 0) return 0;
        if (check_part(r, &part, e) < 0) return -1;
        if (step == EXR_STEP_END) return 0;
        part = (exr_sizes){0};
    }
}
