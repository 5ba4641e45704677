/*
 * exr_compression.h - OpenEXR's compressions: their names, since when there are which, and what a file says.
 *
 * OpenEXR's core library 3.1 takes a compression that it does not know for zip.  So a file is asked before it
 * is.
 */
#ifndef EXR_COMPRESSION_H
#define EXR_COMPRESSION_H

#include <openexr.h>
#include <stdio.h>

#include "exr_header.h"

/* By number, as in the file (ImfCompression.h of each version); since: of those that not every OpenEXR 3 has.
 */
static const struct exr_compression_word {
    const char *name, *since;
} exr_compression_words[] = {{"none", "3.0"}, {"rle", "3.0"},   {"zips", "3.0"},     {"zip", "3.0"},
                             {"piz", "3.0"},  {"pxr24", "3.0"}, {"b44", "3.0"},      {"b44a", "3.0"},
                             {"dwaa", "3.0"}, {"dwab", "3.0"},  {"htj2k256", "3.4"}, {"htj2k32", "3.4"},
                             {"lj2k", "3.5"}, {"zstd", "3.5"}};
enum { EXR_COMPRESSIONS = sizeof exr_compression_words / sizeof *exr_compression_words };

/* The number that the first header states; -1 if it states none or is broken. */
static inline int exr_stated_compression(int fd, uint64_t file_bytes)
{
    unsigned char head[2 * 256 + 5]; /* names have at most 255 characters */
    uint64_t at = 8;                 /* magic number, version */

    while (at < file_bytes) {
        const size_t have = file_bytes - at < sizeof head ? (size_t)(file_bytes - at) : sizeof head;
        if (exr_bytes_at(fd, head, have, at) != 0 || head[0] == 0) return -1;
        const unsigned char *type = memchr(head, 0, have), *size = NULL;
        if (type) size = memchr(type + 1, 0, have - (size_t)(type + 1 - head));
        if (!size || (size_t)(size + 1 - head) + 5 > have) return -1;
        if (!strcmp((const char *)head, "compression") && !strcmp((const char *)type + 1, "compression"))
            return size[5];
        at += (uint64_t)(size + 1 - head) + 4 + exr_u32(size + 1);
    }
    return -1;
}

/* Words for what this OpenEXR can't decompress: "found zstd, ..."; NULL if it can. */
static inline const char *exr_foreign_compression(char *words, size_t room, int number)
{
    int major, minor, patch;
    const char *extra;

    if (number < (int)EXR_COMPRESSION_LAST_TYPE) return NULL;
    exr_get_library_version(&major, &minor, &patch, &extra);
    if (number < EXR_COMPRESSIONS)
        (void)!snprintf(words, room, "found %s, which needs OpenEXR %s or later (this is %d.%d.%d)",
                        exr_compression_words[number].name, exr_compression_words[number].since, major, minor,
                        patch);
    else
        (void)!snprintf(words, room, "found number %d, which OpenEXR %d.%d.%d does not know", number, major,
                        minor, patch);
    return words;
}

#endif
