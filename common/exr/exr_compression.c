/* exr_compression.c - see exr_compression.h. */
#include "exr_compression.h"

#include <openexr.h>
#include <stdio.h>
#include <string.h>

#include "exr_bytes.h"
#include "exr_header.h"

/* By number; since: of those that not every OpenEXR 3 has; lines of a chunk (ImfCompression.cpp). */
static const struct {
    const char *name, *since;
    int lines;
} known[] = {{"none", "3.0", 1},   {"rle", "3.0", 1},    {"zips", "3.0", 1},       {"zip", "3.0", 16},
             {"piz", "3.0", 32},   {"pxr24", "3.0", 16}, {"b44", "3.0", 32},       {"b44a", "3.0", 32},
             {"dwaa", "3.0", 32},  {"dwab", "3.0", 256}, {"htj2k256", "3.4", 256}, {"htj2k32", "3.4", 256},
             {"lj2k", "3.5", 256}, {"zstd", "3.5", 256}};
enum { KNOWN = sizeof known / sizeof *known, MOST_LINES = 256 };

const char *exr_compression_name(int number)
{
    return number >= 0 && number < KNOWN ? known[number].name : NULL;
}

int exr_compression_number(const char *name)
{
    for (int k = 0; k < KNOWN; k++)
        if (!strcmp(known[k].name, name)) return k;
    return -1;
}

int exr_compression_lines(int number)
{
    return number >= 0 && number < KNOWN ? known[number].lines : MOST_LINES;
}

int exr_stated_compression(int fd, uint64_t file_bytes)
{
    unsigned char number;
    exr_walk w;

    if (exr_walk_begin(&w, fd, file_bytes) != 0) return -1;
    while (exr_walk_next(&w) == EXR_STEP_VALUE)
        if (!strcmp(w.name, "compression") && !strcmp(w.type, "compression"))
            return exr_bytes_at(fd, &number, 1, w.value) == 0 ? number : -1;
    return -1;
}

const char *exr_foreign_compression(char *words, size_t room, int number)
{
    int major, minor, patch;
    const char *extra;

    if (number < (int)EXR_COMPRESSION_LAST_TYPE) return NULL;
    exr_get_library_version(&major, &minor, &patch, &extra);
    if (number < KNOWN)
        (void)!snprintf(words, room, "found %s, which needs OpenEXR %s or later (this is %d.%d.%d)",
                        known[number].name, known[number].since, major, minor, patch);
    else
        (void)!snprintf(words, room, "found number %d, which OpenEXR %d.%d.%d does not know", number, major,
                        minor, patch);
    return words;
}
