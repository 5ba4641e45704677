/*
 * exr_header.h - is the header of an OpenEXR file what its own sizes say?
 *
 * For DWA a file is opened a second time by OpenEXR's older library, which reads a value by its type and not
 * by the size that stands before it: a wrong size puts it out of step, and what it then takes for a size it
 * believes and allocates (2 GB for a file of 900 bytes).  So files whose sizes don't fit are kept from it.
 */
#ifndef EXR_HEADER_H
#define EXR_HEADER_H

#include <errno.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

static inline uint32_t exr_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline int exr_bytes_at(int fd, void *to, size_t size, uint64_t at)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n = pread(fd, (char *)to + done, size - done, (off_t)(at + done));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return -1;
        done += (size_t)n;
    }
    return 0;
}

/* A list of channels ends in an empty name at its last byte. */
static inline int exr_channels_sound(int fd, uint64_t at, uint64_t size)
{
    const uint64_t end = at + size;

    while (at < end) {
        unsigned char name[256];
        const size_t have = end - at < sizeof name ? (size_t)(end - at) : sizeof name;
        if (exr_bytes_at(fd, name, have, at) != 0) return 0;
        if (name[0] == 0) return at + 1 == end;
        const unsigned char *stop = memchr(name, 0, have);
        if (!stop) return 0;
        at += (uint64_t)(stop - name) + 1 + 16;
    }
    return 0;
}

static inline int exr_value_sound(int fd, const char *type, uint64_t at, uint64_t size)
{
    static const struct {
        const char *type;
        uint64_t size;
    } fixed[] = {{"box2i", 16},
                 {"box2f", 16},
                 {"chromaticities", 32},
                 {"compression", 1},
                 {"deepImageState", 1},
                 {"double", 8},
                 {"envmap", 1},
                 {"float", 4},
                 {"int", 4},
                 {"keycode", 28},
                 {"lineOrder", 1},
                 {"m33f", 36},
                 {"m33d", 72},
                 {"m44f", 64},
                 {"m44d", 128},
                 {"rational", 8},
                 {"tiledesc", 9},
                 {"timecode", 8},
                 {"v2i", 8},
                 {"v2f", 8},
                 {"v2d", 16},
                 {"v3i", 12},
                 {"v3f", 12},
                 {"v3d", 24}};

    for (size_t k = 0; k < sizeof fixed / sizeof *fixed; k++)
        if (!strcmp(type, fixed[k].type)) return size == fixed[k].size;
    if (!strcmp(type, "chlist")) return exr_channels_sound(fd, at, size);
    if (!strcmp(type, "preview")) {
        unsigned char wh[8];
        return size >= 8 && exr_bytes_at(fd, wh, 8, at) == 0 && (size - 8) % 4 == 0 &&
               (uint64_t)exr_u32(wh) * exr_u32(wh + 4) == (size - 8) / 4;
    }
    return strcmp(type, "floatvector") != 0 || size % 4 == 0;
}

/* Is the name new among the n before it? */
static inline int exr_name_new(uint64_t *names, int n, const unsigned char *name)
{
    uint64_t hash = 0xcbf29ce484222325u; /* FNV-1a */

    for (; *name; name++) hash = (hash ^ *name) * 0x100000001b3u;
    for (int k = 0; k < n; k++)
        if (names[k] == hash) return 0;
    names[n] = hash;
    return 1;
}

/* 1 if every value of every header ends inside the file, is as long as its type, and stands there once: of
 * two the libraries take different ones. */
static inline int exr_header_sound(int fd, uint64_t file_bytes)
{
    enum { MOST = 1024 };
    unsigned char head[2 * 256 + 4]; /* names have at most 255 characters */
    uint64_t at = 8, names[MOST];
    int n = 0;

    if (file_bytes < 8 || exr_bytes_at(fd, head, 8, 0) != 0) return 0;
    const int parts = (exr_u32(head + 4) & 0x1000) != 0;
    while (at < file_bytes) {
        const size_t have = file_bytes - at < sizeof head ? (size_t)(file_bytes - at) : sizeof head;
        if (exr_bytes_at(fd, head, have, at) != 0) return 0;
        if (head[0] == 0) {
            if (!parts || (have > 1 && head[1] == 0)) return 1;
            at++;
            n = 0;
            continue;
        }
        const unsigned char *type = memchr(head, 0, have), *size = NULL;
        if (!type || n == MOST || !exr_name_new(names, n++, head)) return 0;
        size = memchr(type + 1, 0, have - (size_t)(type + 1 - head));
        if (!size || (size_t)(size + 1 - head) + 4 > have) return 0;
        at += (uint64_t)(size + 1 - head) + 4;
        const uint64_t bytes = exr_u32(size + 1);
        if (bytes > file_bytes - at || !exr_value_sound(fd, (const char *)type + 1, at, bytes)) return 0;
        at += bytes;
    }
    return 0;
}

#endif
