/* fuzz_falloff.c - falloff curves: fishremap's text and JSON files. */
#include <math.h>

#include "fishremap/falloff.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const double halves[] = {.8, 1.6144};
    static falloff f; /* 50 kB */
    fuzz_file file = file_of(data, size);
    errmsg e = {""};

    for (int k = 0; k < 4; k++) {
        if (falloff_read(&f, file.path, halves[k & 1], k & 2 ? "f4" : NULL, k & 1 ? 5.6 : 0, &e) != 0) {
            one_line(e.text);
            continue;
        }
        for (int c = 0; c < 3; c++)
            for (int s = 0; s <= FALLOFF_STEPS; s++) HOLDS(isfinite(f.v[c][s]) && f.v[c][s] > 0);
    }
    close(file.fd);
    return 0;
}
