/* fuzz_lens.c - lens files: what is accepted maps angles to radii and back. */
#include <math.h>

#include "fishremap/lensfile.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const double fields[] = {0, 60, 185, 360};
    fuzz_file file = file_of(data, size);
    lens l;
    errmsg e = {""};

    for (size_t k = 0; k < sizeof fields / sizeof *fields; k++) {
        if (lens_read(&l, file.path, fields[k], &e) != 0) {
            one_line(e.text);
            continue;
        }
        HOLDS(l.half > 0 && isfinite(l.half));
        HOLDS(fabs(lens_radius(NULL, &l, l.half) - 1) < 1e-6);
        for (double r = 0; r <= 1; r += 1. / 16) {
            const double t = lens_angle(&l, r);
            HOLDS(t >= 0 && t <= l.half * (1 + 1e-12));
            /* to rounding of the radius, or, where the curve is steep, of the angle */
            const double below = nextafter(nextafter(t, 0), 0), above = nextafter(nextafter(t, 4), 4);
            HOLDS(fabs(lens_radius(NULL, &l, t) - r) < 1e-12 ||
                  (lens_radius(NULL, &l, below) <= r && lens_radius(NULL, &l, above) >= r));
        }
    }
    close(file.fd);
    return 0;
}
