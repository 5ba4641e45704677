/* fuzz_response.c - response files as hdrgen reads them. */
#include <math.h>

#include "fuzz.h"
#include "hdrgen/response.h"

static void check_response(const char *path, int channels, int max_code)
{
    response r;
    errmsg e = {""};

    if (response_load(&r, path, channels, max_code, &e) != 0) {
        one_line(e.text);
        return;
    }
    HOLDS(r.channels == channels && r.max_code == max_code);
    for (int c = 0; c < channels; c++) {
        HOLDS(r.finv[c][0] <= 0 && r.finv[c][0] >= 0);
        for (int z = 1; z <= max_code; z++) HOLDS(isfinite(r.finv[c][z]) && r.finv[c][z] > r.finv[c][z - 1]);
    }
    response_free(&r);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_file file = file_of(data, size);

    check_response(file.path, 3, 255);
    check_response(file.path, 1, 1023);
    close(file.fd);
    return 0;
}
