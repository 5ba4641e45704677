/*
 * image_exif.c - how a picture is to be looked at: EXIF's orientation (Exif 2.3, tag 0x0112 of the first
 * directory).
 *
 * It is read from a block in memory that may hold anything; what can't be read says nothing.  The
 * orientation is what libexif's exif_data_get_entry(EXIF_TAG_ORIENTATION) gives; here one number of each
 * picture's first directory is wanted, without libexif's copy of all that the block holds, and by programs
 * that don't link it.
 */
#include <string.h>

#include "image_internal.h"

static uint32_t number(const unsigned char *p, int bytes, int big)
{
    uint32_t v = 0;
    for (int i = 0; i < bytes; i++) v |= (uint32_t)p[big ? bytes - 1 - i : i] << (8 * i);
    return v;
}

int img_exif_orientation(const unsigned char *block, size_t n)
{
    enum { ORIENTATION = 0x0112, SHORT = 3, LONG = 4, ENTRY = 12 };
    if (n >= 6 && memcmp(block, "Exif\0", 6) == 0) block += 6, n -= 6;
    if (n < 8 || !(memcmp(block, "II*\0", 4) == 0 || memcmp(block, "MM\0*", 4) == 0)) return 1;
    int big = block[0] == 'M';
    size_t at = number(block + 4, 4, big);
    if (at > n - 2) return 1;
    uint32_t entries = number(block + at, 2, big);
    for (at += 2; entries > 0 && n - at >= ENTRY; entries--, at += ENTRY) {
        const unsigned char *p = block + at;
        uint32_t type = number(p + 2, 2, big), count = number(p + 4, 4, big);
        if (number(p, 2, big) != ORIENTATION || count < 1 || (type != SHORT && type != LONG)) continue;
        uint32_t v = number(p + 8, type == SHORT ? 2 : 4, big);
        return v >= 1 && v <= 8 ? (int)v : 1;
    }
    return 1;
}
