/*
 * exr_bytes.h - OpenEXR's numbers: little-endian, at any place of a file.
 */
#ifndef EXR_BYTES_H
#define EXR_BYTES_H

#include <errno.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

static inline uint32_t exr_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint64_t exr_u64(const unsigned char *p)
{
    return (uint64_t)exr_u32(p) | (uint64_t)exr_u32(p + 4) << 32;
}

/* Do n bytes of a file's beginning say that it is OpenEXR? */
static inline int exr_is_magic(const unsigned char *head, size_t n)
{
    return n >= 4 && exr_u32(head) == 20000630;
}

/* All of `size` bytes: 0; -1 where they can't be read. */
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

#endif
