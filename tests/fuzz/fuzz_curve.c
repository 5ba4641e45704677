/* fuzz_curve.c - the virtual camera's falloff and response curves. */
#include <math.h>

#include "fuzz.h"
#include "twin/curvefile.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_file file = file_of(data, size);
    curve3 curve;
    errmsg e = {""};

    if (curve_load_falloff(&curve, file.path, &e) != 0) one_line(e.text);
    else {
        for (int c = 0; c < 3; c++)
            for (double x = -1; x < 100; x += 7)
                HOLDS(isfinite(curve3_at(&curve, c, x)) && curve3_at(&curve, c, x) > 0);
        curve_free(&curve);
    }
    if (curve_load_response(&curve, file.path, &e) != 0) one_line(e.text);
    else {
        for (int c = 0; c < 3; c++)
            for (double x = 0; x <= 1; x += .125) HOLDS(isfinite(curve3_inverse(&curve, c, x)));
        curve_free(&curve);
    }
    close(file.fd);
    return 0;
}
