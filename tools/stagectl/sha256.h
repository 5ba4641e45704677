/*
 * sha256.h - SHA-256 (FIPS 180-4): digests of captured files and keys of cached renderings.
 */
#ifndef SHA256_H
#define SHA256_H

#include <stddef.h>
#include <stdint.h>

#include "base/errmsg.h"

typedef struct sha256 {
    uint32_t state[8];
    uint64_t bytes;
    unsigned char block[64];
} sha256;

void sha256_begin(sha256 *s);
void sha256_add(sha256 *s, const void *data, size_t n);
void sha256_end(sha256 *s, char hex[65]); /* lower-case, NUL-terminated; s is used up */

/* Digest and size in bytes of a whole file. */
int sha256_file(char hex[65], int64_t *size, const char *path, errmsg *e);

#endif
