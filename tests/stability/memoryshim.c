/*
 * memoryshim.c - make a chosen allocation fail: LD_PRELOAD=memoryshim.so MEMORY=N[,BYTES] program ...
 *
 * Counted are the calls of malloc, calloc and realloc that the program's own code makes (not those that its
 * libraries make), of BYTES and more; the N-th returns NULL.  MEMORY_LOG=FILE gets the number of such calls
 * when the program ends.
 */
#include <elf.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

extern void *__libc_malloc(size_t n);
extern void *__libc_calloc(size_t n, size_t size);
extern void *__libc_realloc(void *p, size_t n);

static uintptr_t from, to; /* the program's code */
static long wanted, count;
static size_t least;
static const char *log_name;

static int program_range(struct dl_phdr_info *info, size_t size, void *arg)
{
    (void)size, (void)arg;
    for (int k = 0; k < info->dlpi_phnum; k++)
        if (info->dlpi_phdr[k].p_type == PT_LOAD && (info->dlpi_phdr[k].p_flags & PF_X)) {
            from = info->dlpi_addr + info->dlpi_phdr[k].p_vaddr;
            to = from + info->dlpi_phdr[k].p_memsz;
        }
    return 1; /* the first one is the program */
}

__attribute__((constructor)) static void read_wish(void)
{
    const char *wish = getenv("MEMORY");
    const char *comma = wish ? strchr(wish, ',') : NULL;
    log_name = getenv("MEMORY_LOG");
    wanted = wish ? atol(wish) : 0;
    least = comma ? (size_t)atol(comma + 1) : 0;
    dl_iterate_phdr(program_range, NULL);
}

__attribute__((destructor)) static void say(void)
{
    char line[32];
    int fd = log_name ? open(log_name, O_WRONLY | O_CREAT | O_TRUNC, 0666) : -1;
    if (fd < 0) return;
    int n = snprintf(line, sizeof line, "%ld\n", count);
    if (write(fd, line, (size_t)n) < 0) {
    }
    close(fd);
}

static int fails(const void *caller, size_t bytes)
{
    uintptr_t at = (uintptr_t)caller;
    if (at < from || at >= to || bytes < least) return 0;
    if (__atomic_add_fetch(&count, 1, __ATOMIC_RELAXED) != wanted) return 0;
    errno = ENOMEM;
    return 1;
}

void *malloc(size_t n)
{
    return fails(__builtin_return_address(0), n) ? NULL : __libc_malloc(n);
}

void *calloc(size_t n, size_t size)
{
    return fails(__builtin_return_address(0), n * size) ? NULL : __libc_calloc(n, size);
}

void *realloc(void *p, size_t n)
{
    return n && fails(__builtin_return_address(0), n) ? NULL : __libc_realloc(p, n);
}
