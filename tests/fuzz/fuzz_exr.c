/* fuzz_exr.c - OpenEXR pictures of any kind: header only, then all rows. */
#include "fuzz_image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size >= 4 && !memcmp(data, "v/1\1", 4)) read_picture(data, size);
    return 0;
}
