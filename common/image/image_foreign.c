/*
 * image_foreign.c - pictures that we don't read but know by their first bytes, and what converts them.
 *
 * ISO base media files (HEIF, AVIF) say "ftyp" and a brand at byte 4 (ISO/IEC 14496-12, 23008-12); WebP is
 * RIFF; JPEG XL is a bare codestream (FF 0A) or a container (ISO/IEC 18181-2).
 */
#include <string.h>

#include "image_internal.h"

const char *img_foreign(const unsigned char *head, size_t n)
{
    static const unsigned char jxl[12] = {0, 0, 0, 12, 'J', 'X', 'L', ' ', 13, 10, 0x87, 10};
    static const char *const heif[] = {"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1"};
    if (n >= 12 && memcmp(head, jxl, 12) == 0) return "JPEG XL: convert it with djxl IN.jxl OUT.png";
    if (n >= 2 && head[0] == 0xff && head[1] == 0x0a) return "JPEG XL: convert it with djxl IN.jxl OUT.png";
    if (n >= 12 && memcmp(head, "RIFF", 4) == 0 && memcmp(head + 8, "WEBP", 4) == 0)
        return "WebP: convert it with dwebp IN.webp -o OUT.png";
    if (n < 12 || memcmp(head + 4, "ftyp", 4) != 0) return NULL;
    if (memcmp(head + 8, "avif", 4) == 0 || memcmp(head + 8, "avis", 4) == 0)
        return "AVIF: convert it with avifdec -d 16 IN.avif OUT.png";
    for (size_t i = 0; i < sizeof heif / sizeof *heif; i++)
        if (memcmp(head + 8, heif[i], 4) == 0)
            return "HEIF (HEIC): convert it with heif-convert IN.heic OUT.png, exposure times in --times";
    return NULL;
}
