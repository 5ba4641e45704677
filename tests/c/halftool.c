/*
 * halftool - our conversions of binary16, raw numbers of the machine in and out.
 *
 *   halftool any      all 65536 halves as floats
 *   halftool finite   the same by the conversion for finite ones
 *   halftool from     floats on stdin as halves
 */
#include <stdio.h>
#include <string.h>

#include "exr/exr_half.h"

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    float v;
    if (strcmp(what, "from") == 0) {
        while (fread(&v, sizeof v, 1, stdin) == 1) {
            uint16_t h = half_from_float(v);
            fwrite(&h, sizeof h, 1, stdout);
        }
    } else if (strcmp(what, "any") == 0 || strcmp(what, "finite") == 0) {
        for (unsigned h = 0; h < 65536; h++) {
            v = *what == 'a' ? half_to_float_any((uint16_t)h) : half_to_float((uint16_t)h);
            fwrite(&v, sizeof v, 1, stdout);
        }
    } else return 2;
    return fflush(stdout) != 0;
}
