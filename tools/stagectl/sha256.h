/*
 * sha256.h - SHA-256 (FIPS 180-4) by OpenSSL's libcrypto: digests of captured files and keys of cached
 * renderings.
 */
#ifndef SHA256_H
#define SHA256_H

#include <stddef.h>
#include <stdint.h>

#include "base/errmsg.h"

/* Begun, it must be ended. */
typedef struct sha256 {
    struct evp_md_ctx_st *context; /* NULL: out of memory */
    int64_t bytes;
    int failed;
} sha256;

void sha256_begin(sha256 *s);
void sha256_add(sha256 *s, const void *data, size_t n);

/* hex: lower-case, NUL-terminated; s is used up.  What failed since sha256_begin is told here: -1. */
int sha256_end(sha256 *s, char hex[65], errmsg *e);

/* Digest and size in bytes of a whole file. */
int sha256_file(char hex[65], int64_t *size, const char *path, errmsg *e);

#endif
