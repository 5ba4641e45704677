/*
 * image_exr_check.c - OpenEXR's library believes a header: it reads values by their types, and takes memory
 * for tables and chunks of the sizes stated.  Here they are held against the size of the file first.
 *
 * A file has one table entry of 8 bytes for each chunk, so that it can't have more chunks than an eighth of
 * its bytes; and no compression makes a chunk thousands of times smaller than it is.
 */
#include <limits.h>
#include <openexr.h>
#include <string.h>

#include "exr/exr_header.h"
#include "image_exr.h"

enum { SMALL = 64 << 20, SHRINK = 4096 }; /* a chunk beyond SMALL bytes may be SHRINK times the file */

typedef struct sizes {
    int64_t w, h;
    uint64_t pixel_bytes; /* of all channels */
    int tiled, deep;
    uint32_t tile_w, tile_h;
    int compression;
    int64_t chunks; /* chunkCount, 0: not stated */
} sizes;

/* OpenEXR's numbers beyond those of the library in use. */
static int newer_compression(const img_reader *r, int code, errmsg *e)
{
    static const struct {
        const char *name, *since;
    } later[] = {{"HTJ2K256", "3.4"}, {"HTJ2K32", "3.4"}, {"LJ2K", "3.5"}, {"ZSTD", "3.5"}};
    const int first = 10;
    if (code < EXR_COMPRESSION_LAST_TYPE) return 0;
    if (code < first + (int)(sizeof later / sizeof *later))
        return img_bad(r, e, "compressed with %s, which needs OpenEXR %s; this program has %s",
                       later[code - first].name, later[code - first].since, OPENEXR_VERSION_STRING);
    return img_bad(r, e, "expected a compression that OpenEXR %s knows, found number %d",
                   OPENEXR_VERSION_STRING, code);
}

static int lines_per_chunk(int compression)
{
    switch (compression) {
    case EXR_COMPRESSION_ZIP:
    case EXR_COMPRESSION_PXR24: return 16;
    case EXR_COMPRESSION_PIZ:
    case EXR_COMPRESSION_B44:
    case EXR_COMPRESSION_B44A:
    case EXR_COMPRESSION_DWAA: return 32;
    case EXR_COMPRESSION_NONE:
    case EXR_COMPRESSION_RLE:
    case EXR_COMPRESSION_ZIPS: return 1;
    default: return 256; /* DWAB, and what is newer */
    }
}

static int check_part(const img_reader *r, const sizes *s, errmsg *e)
{
    if (newer_compression(r, s->compression, e) < 0 || img_check_size(r->path, s->w, s->h, e) < 0) return -1;
    int64_t lines = lines_per_chunk(s->compression), chunks = s->chunks, fewest = (s->h + lines - 1) / lines;
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

/* Sum over a list of channels: name, 0, type, four bytes, samplings.  exr_header_sound() has walked it. */
static uint64_t channel_bytes(int fd, uint64_t at, uint64_t size)
{
    uint64_t end = at + size, sum = 0;
    while (at + 1 < end) {
        unsigned char p[256 + 16];
        size_t have = end - at < sizeof p ? (size_t)(end - at) : sizeof p;
        if (exr_bytes_at(fd, p, have, at) != 0) break;
        const unsigned char *stop = memchr(p, 0, have);
        if (!stop || (size_t)(stop - p) + 17 > have) break;
        sum += exr_u32(stop + 1) == 1 ? 2 : 4; /* HALF, else UINT or FLOAT */
        at += (uint64_t)(stop - p) + 17;
    }
    return sum;
}

static void take_value(sizes *s, int fd, const char *name, uint64_t at, uint64_t size)
{
    unsigned char v[16] = {0};
    if (exr_bytes_at(fd, v, size < sizeof v ? (size_t)size : sizeof v, at) != 0) return;
    if (strcmp(name, "dataWindow") == 0 && size == 16) {
        s->w = (int64_t)(int32_t)exr_u32(v + 8) - (int32_t)exr_u32(v) + 1;
        s->h = (int64_t)(int32_t)exr_u32(v + 12) - (int32_t)exr_u32(v + 4) + 1;
    } else if (strcmp(name, "compression") == 0 && size == 1) {
        s->compression = v[0];
    } else if (strcmp(name, "tiles") == 0 && size == 9) {
        s->tiled = 1;
        s->tile_w = exr_u32(v);
        s->tile_h = exr_u32(v + 4);
    } else if (strcmp(name, "type") == 0) {
        s->deep = memcmp(v, "deep", 4) == 0;
        if (size == 13 && memcmp(v, "scanlineimage", 13) == 0) s->tiled = 0;
    } else if (strcmp(name, "chunkCount") == 0 && size == 4) {
        int32_t n = (int32_t)exr_u32(v);
        s->chunks = n > 0 ? n : 0;
    } else if (strcmp(name, "channels") == 0) {
        s->pixel_bytes = channel_bytes(fd, at, size);
    }
}

int exr_check(const img_reader *r, errmsg *e)
{
    unsigned char head[2 * 256 + 4];
    int fd = fileno(r->f), attributes = 0;
    uint64_t at = 8, bytes = (uint64_t)r->bytes;
    sizes part = {0};
    if (!exr_header_sound(fd, bytes))
        return img_bad(r, e, "broken OpenEXR file: header whose sizes don't fit");
    if (exr_bytes_at(fd, head, 8, 0) != 0) return img_bad(r, e, "can't read");
    int parts = (exr_u32(head + 4) & 0x1000) != 0;
    while (at < bytes) {
        size_t have = bytes - at < sizeof head ? (size_t)(bytes - at) : sizeof head;
        if (exr_bytes_at(fd, head, have, at) != 0) break;
        if (head[0] == 0) { /* the end of a part's header; of all, if nothing follows */
            if (parts && attributes == 0) return 0;
            if (check_part(r, &part, e) < 0) return -1;
            if (!parts) return 0;
            memset(&part, 0, sizeof part);
            attributes = 0;
            at++;
            continue;
        }
        const unsigned char *type = memchr(head, 0, have);
        const unsigned char *size = type ? memchr(type + 1, 0, have - (size_t)(type + 1 - head)) : NULL;
        if (!size || (size_t)(size + 1 - head) + 4 > have) break;
        uint64_t n = exr_u32(size + 1);
        at += (uint64_t)(size + 1 - head) + 4;
        take_value(&part, fd, (const char *)head, at, n);
        attributes++;
        at += n;
    }
    return img_bad(r, e, "broken OpenEXR file: header");
}
