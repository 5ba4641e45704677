/*
 * fuzz.h - what the fuzz targets share.
 *
 * A target is one function that takes any bytes, gives them to one parser and aborts when what
 * the parser promises does not hold: accepted means finite, in range and usable; refused means one line of
 * words. libFuzzer drives it under clang (make fuzz); replay.c runs the kept corpus under any compiler (make
 * test).
 */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Unlike assert() not taken out by NDEBUG, and it says what broke. */
#define HOLDS(what)                                                                                          \
    do {                                                                                                     \
        if (!(what)) {                                                                                       \
            fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #what);                        \
            abort();                                                                                         \
        }                                                                                                    \
    } while (0)

/* A refusal is one line of printable words. */
static inline void one_line(const char *words)
{
    HOLDS(words[0] != 0);
    for (const char *p = words; *p; p++) HOLDS((unsigned char)*p >= 0x20);
}

typedef struct fuzz_file {
    int fd;
    char path[40];
} fuzz_file;

/* The bytes as a regular file in memory, for parsers that open by name. */
static inline fuzz_file file_of(const uint8_t *data, size_t size)
{
    fuzz_file f = {memfd_create("input", MFD_CLOEXEC), ""};

    HOLDS(f.fd >= 0);
    for (size_t done = 0; done < size;) {
        const ssize_t n = write(f.fd, data + done, size - done);
        HOLDS(n > 0);
        done += (size_t)n;
    }
    snprintf(f.path, sizeof f.path, "/proc/self/fd/%d", f.fd);
    return f;
}

#endif
