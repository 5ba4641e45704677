/* sha256.c - see sha256.h. */
#include "sha256.h"

#include <errno.h>
#include <fcntl.h>
#include <openssl/evp.h>
#include <unistd.h>

void sha256_begin(sha256 *s)
{
    s->context = EVP_MD_CTX_new();
    s->bytes = 0;
    s->failed = !s->context || !EVP_DigestInit_ex(s->context, EVP_sha256(), NULL);
}

void sha256_add(sha256 *s, const void *data, size_t n)
{
    s->failed = s->failed || !EVP_DigestUpdate(s->context, data, n);
    s->bytes += (int64_t)n;
}

int sha256_end(sha256 *s, char hex[65], errmsg *e)
{
    static const char digits[] = "0123456789abcdef";
    unsigned char sum[EVP_MAX_MD_SIZE];
    s->failed = s->failed || !EVP_DigestFinal_ex(s->context, sum, NULL);
    EVP_MD_CTX_free(s->context);
    s->context = NULL;
    if (s->failed) return err_set(e, "SHA-256: out of memory");
    for (int i = 0; i < 64; i++) hex[i] = digits[sum[i / 2] >> (i & 1 ? 0 : 4) & 15];
    hex[64] = 0;
    return 0;
}

int sha256_file(char hex[65], int64_t *size, const char *path, errmsg *e)
{
    unsigned char buf[65536];
    sha256 s;
    ssize_t n;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return err_errno(e, "%s", path);
    sha256_begin(&s);
    while ((n = read(fd, buf, sizeof buf)) != 0) {
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) break;
        sha256_add(&s, buf, (size_t)n);
    }
    int bad = n < 0 ? err_errno(e, "%s", path) : 0;
    close(fd);
    *size = s.bytes;
    errmsg why;
    if (sha256_end(&s, hex, &why) != 0 && !bad) bad = err_set(e, "%s: %s", path, why.text);
    return bad;
}
