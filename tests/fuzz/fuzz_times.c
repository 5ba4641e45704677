/* fuzz_times.c - exposure times from a file, and the exposures that they make. */
#include <math.h>

#include "fuzz.h"
#include "hdrgen/times.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_file file = file_of(data, size);
    shot shots[3] = {{.path = "a.png"}, {.path = "in/b c.png", .iso = 100, .f_number = 4}, {.path = "c.png"}};
    times_facts facts = {0};
    errmsg e = {""};

    if (times_load(shots, 3, file.path, &e) != 0) {
        one_line(e.text);
        for (int k = 0; k < 3; k++) HOLDS(shots[k].seconds >= 0 && shots[k].seconds <= 0);
    } else {
        for (int k = 0; k < 3; k++) HOLDS(shots[k].seconds > 0);
        if (shots_resolve(shots, 3, 1, &facts, &e) != 0) one_line(e.text);
        else
            for (int k = 0; k < 3; k++) HOLDS(isfinite(shots[k].exposure) && shots[k].exposure > 0);
    }
    close(file.fd);
    return 0;
}
