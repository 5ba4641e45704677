/*
 * faultshim.c - make a chosen call fail: LD_PRELOAD=faultshim.so FAULT=WHAT:HOW:N[:FILE] program ...
 *
 *   WHAT  read write open fsync rename close ftruncate fwrite (fwrite: the C library's own writes of a
 *         stream, which don't pass through write() where they can be seen from outside)
 *   HOW   ENOSPC EIO EINTR EDQUOT: that error; SHORT: half of what was asked for (read, write); ONE: one
 *         byte; KILL: SIGKILL before the call
 *   N     the N-th such call (from 1), "N+" that and all after it
 *   FILE  counts calls on files whose name contains FILE only
 *
 * EINTR and short counts are no failures: a program has to go on.
 *
 * FAULT_LOG=FILE notes the calls that make things durable, in order: "write|fsync|fdatasync|syncfs|rename
 * PATH".
 */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

enum { NONE, SHORT = -1, ONE = -2, KILL = -3 };

static char what[16], only[256];
static int how, onward;
static long wanted, count;

__attribute__((constructor)) static void read_wish(void)
{
    char name[16] = "";
    const char *wish = getenv("FAULT");
    static const struct {
        const char *name;
        int how;
    } known[] = {{"ENOSPC", ENOSPC}, {"EIO", EIO}, {"EINTR", EINTR}, {"EDQUOT", EDQUOT},
                 {"SHORT", SHORT},   {"ONE", ONE}, {"KILL", KILL}};

    if (!wish || sscanf(wish, "%15[^:]:%15[^:]:%ld", what, name, &wanted) != 3) return;
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        if (!strcmp(name, known[k].name)) how = known[k].how;
    const char *p = wish;
    for (int colons = 0; *p && colons < 2; p++) colons += *p == ':';
    onward = strchr(p, '+') && (!strchr(p, ':') || strchr(p, '+') < strchr(p, ':'));
    const char *file = strchr(p, ':');
    snprintf(only, sizeof only, "%s", file ? file + 1 : "");
}

/* Without the functions that are watched. */
static void note(const char *call, const char *path, int fd)
{
    const char *log = getenv("FAULT_LOG");
    char link[64], name[PATH_MAX], line[PATH_MAX + 32];

    if (!log || !strcmp(call, "open") || !strcmp(call, "read") || !strcmp(call, "fread")) return;
    if (!path) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
        const ssize_t n = readlink(link, name, sizeof name - 1);
        if (n < 0) return;
        name[n] = 0;
        path = name;
    }
    const int to = (int)syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
    const int n = snprintf(line, sizeof line, "%s %s\n", call, path);
    if (to >= 0 && n > 0 && syscall(SYS_write, to, line, (size_t)n) < 0) abort();
    if (to >= 0) close(to);
}

static int concerns(const char *call, const char *path, int fd)
{
    char link[64], name[PATH_MAX];

    note(call, path, fd);

    if (how == NONE || strcmp(call, what) != 0) return 0;
    if (only[0]) {
        if (!path) {
            snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
            const ssize_t n = readlink(link, name, sizeof name - 1);
            if (n < 0) return 0;
            name[n] = 0;
            path = name;
        }
        if (!strstr(path, only)) return 0;
    }
    const long n = __atomic_add_fetch(&count, 1, __ATOMIC_SEQ_CST);
    if (n != wanted && !(onward && n > wanted)) return 0;
    if (how == KILL) {
        kill(getpid(), SIGKILL);
        for (;;) pause();
    }
    return 1;
}

/* 1: fails, errno is set; 0: goes on with what may be less */
static int spoil(size_t *n)
{
    if (how > 0) {
        errno = how;
        return 1;
    }
    if (*n > 1) *n = how == ONE ? 1 : *n / 2;
    return 0;
}

static void *real(const char *name)
{
    void *p = dlsym(RTLD_NEXT, name);

    if (!p) abort();
    return p;
}

ssize_t read(int fd, void *to, size_t n)
{
    ssize_t (*f)(int, void *, size_t);
    *(void **)&f = real("read");
    if (concerns("read", NULL, fd) && spoil(&n)) return -1;
    return f(fd, to, n);
}

static ssize_t pread_as(const char *name, int fd, void *to, size_t n, off_t at)
{
    ssize_t (*f)(int, void *, size_t, off_t);
    *(void **)&f = real(name);
    if (concerns("read", NULL, fd) && spoil(&n)) return -1;
    return f(fd, to, n, at);
}

ssize_t pread(int fd, void *to, size_t n, off_t at)
{
    return pread_as("pread", fd, to, n, at);
}

ssize_t pread64(int fd, void *to, size_t n, off_t at)
{
    return pread_as("pread64", fd, to, n, at);
}

ssize_t write(int fd, const void *from, size_t n)
{
    ssize_t (*f)(int, const void *, size_t);
    *(void **)&f = real("write");
    if (concerns("write", NULL, fd) && spoil(&n)) return -1;
    return f(fd, from, n);
}

static ssize_t pwrite_as(const char *name, int fd, const void *from, size_t n, off_t at)
{
    ssize_t (*f)(int, const void *, size_t, off_t);
    *(void **)&f = real(name);
    if (concerns("write", NULL, fd) && spoil(&n)) return -1;
    return f(fd, from, n, at);
}

ssize_t pwrite(int fd, const void *from, size_t n, off_t at)
{
    return pwrite_as("pwrite", fd, from, n, at);
}

ssize_t pwrite64(int fd, const void *from, size_t n, off_t at)
{
    return pwrite_as("pwrite64", fd, from, n, at);
}

static int open_as(const char *name, const char *path, int flags, mode_t mode)
{
    int (*f)(const char *, int, ...);
    size_t one = 1;
    *(void **)&f = real(name);
    if (concerns("open", path, -1) && how > 0 && spoil(&one)) return -1;
    return f(path, flags, mode);
}

#define OPEN(name)                                                                                           \
    int name(const char *path, int flags, ...)                                                               \
    {                                                                                                        \
        va_list ap;                                                                                          \
        va_start(ap, flags);                                                                                 \
        const mode_t mode = va_arg(ap, mode_t);                                                              \
        va_end(ap);                                                                                          \
        return open_as(#name, path, flags, mode);                                                            \
    }
OPEN(open)
OPEN(open64)

static FILE *fopen_as(const char *name, const char *path, const char *mode)
{
    FILE *(*f)(const char *, const char *);
    size_t one = 1;
    *(void **)&f = real(name);
    if (concerns("open", path, -1) && how > 0 && spoil(&one)) return NULL;
    return f(path, mode);
}

FILE *fopen(const char *path, const char *mode)
{
    return fopen_as("fopen", path, mode);
}

FILE *fopen64(const char *path, const char *mode)
{
    return fopen_as("fopen64", path, mode);
}

/* The C library's streams call its own write: seen here at the calls that fill and empty them.  A stream
 * remembers that it failed. */
static void failed(FILE *f)
{
    f->_flags |= 0x20; /* glibc's _IO_ERR_SEEN: what ferror() looks at */
}

size_t fwrite(const void *from, size_t size, size_t n, FILE *to)
{
    size_t (*f)(const void *, size_t, size_t, FILE *), one = 1;
    *(void **)&f = real("fwrite");
    if (concerns("fwrite", NULL, fileno(to)) && how > 0 && spoil(&one)) {
        failed(to);
        return 0;
    }
    return f(from, size, n, to);
}

size_t fread(void *to, size_t size, size_t n, FILE *from)
{
    size_t (*f)(void *, size_t, size_t, FILE *), one = 1;
    *(void **)&f = real("fread");
    if (concerns("fread", NULL, fileno(from)) && how > 0 && spoil(&one)) {
        failed(from);
        return 0;
    }
    return f(to, size, n, from);
}

int fflush(FILE *to)
{
    int (*f)(FILE *);
    size_t one = 1;
    *(void **)&f = real("fflush");
    if (to && concerns("fflush", NULL, fileno(to)) && how > 0 && spoil(&one)) {
        failed(to);
        return EOF;
    }
    return f(to);
}

#define ON_FD(name)                                                                                          \
    int name(int fd)                                                                                         \
    {                                                                                                        \
        int (*f)(int);                                                                                       \
        size_t one = 1;                                                                                      \
        *(void **)&f = real(#name);                                                                          \
        if (concerns(#name, NULL, fd) && how > 0 && spoil(&one)) return -1;                                  \
        return f(fd);                                                                                        \
    }
ON_FD(fsync)
ON_FD(fdatasync)
ON_FD(syncfs)

int ftruncate(int fd, off_t size)
{
    int (*f)(int, off_t);
    size_t one = 1;
    *(void **)&f = real("ftruncate");
    if (concerns("ftruncate", NULL, fd) && how > 0 && spoil(&one)) return -1;
    return f(fd, size);
}

int rename(const char *from, const char *to)
{
    int (*f)(const char *, const char *);
    size_t one = 1;
    *(void **)&f = real("rename");
    if (concerns("rename", to, -1) && how > 0 && spoil(&one)) return -1;
    return f(from, to);
}
