/*
 * replay.c - a fuzz target without a fuzzer: each file named on the command line once, so that what was
 * ever found stays fixed under every compiler.
 */
#include "fuzz.h"

int main(int argc, char **argv)
{
    enum { MOST = 1 << 24 };
    uint8_t *data = malloc(MOST);

    if (!data) return 1;
    for (int k = 1; k < argc; k++) {
        FILE *f = fopen(argv[k], "rb");
        if (!f) {
            perror(argv[k]);
            return 1;
        }
        const size_t n = fread(data, 1, MOST, f);
        fclose(f);
        /* a block of just that size: reading past its end is then seen by ASan */
        uint8_t *own = malloc(n ? n : 1);
        if (!own) return 1;
        memcpy(own, data, n);
        fprintf(stderr, "%s\n", argv[k]);
        LLVMFuzzerTestOneInput(own, n);
        free(own);
    }
    free(data);
    printf("%d inputs\n", argc - 1);
    return 0;
}
