/* fuzz_pnm.c - PNM and PFM pictures: header only, then all rows. */
#include "fuzz_image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size >= 2 && data[0] == 'P') read_picture(data, size);
    return 0;
}
