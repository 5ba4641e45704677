/*
 * outfile.c - outputs that are whole or not there; see outfile.h.
 *
 * The temporary files that are open stand in a fixed table which a signal handler can walk:
 * no locks, no freed memory, and a process id, so that a forked child never removes its
 * parent's files.  A name enters the table before the file is made and leaves it after the
 * file is gone or renamed; so a signal at any instant leaves nothing behind.
 */
#include "outfile.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MAX_OPEN = 64, FREE = 0, CLAIMED, LIVE };

static struct slot {
    atomic_int state;
    pid_t pid;
    char path[PATH_MAX];
} slots[MAX_OPEN];

struct outfile {
    struct slot *slot;
    FILE *stream;
    char *target; /* NULL: standard output */
    char *shown;  /* the target as the user named it */
    int copy;     /* the target is copied to, not renamed over */
    mode_t mode;  /* of the regular file that is replaced; 0: none */
};

void out_cleanup(void)
{
    for (int i = 0; i < MAX_OPEN; i++) {
        if (atomic_load(&slots[i].state) == LIVE && slots[i].pid == getpid()) unlink(slots[i].path);
    }
}

static struct slot *claim(void)
{
    for (int i = 0; i < MAX_OPEN; i++) {
        int expected = FREE;
        if (atomic_compare_exchange_strong(&slots[i].state, &expected, CLAIMED)) return &slots[i];
    }
    return NULL;
}

static int random_name(char *out, int n)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";
    unsigned char r[16];
    ssize_t got;
    do got = getrandom(r, (size_t)n, 0);
    while (got < 0 && errno == EINTR);
    if (got != n) return -1;
    for (int i = 0; i < n; i++) out[i] = letters[r[i] % (sizeof letters - 1)];
    return 0;
}

/* Make ".NAME.XXXXXX" in the folder of target; sets s->path and returns a descriptor or -1 with errno. */
static int make_temp(struct slot *s, const char *target)
{
    enum { RANDOM = 6, NAME = 200 }; /* a name may have 255 bytes with its dots and letters */
    const char *slash = strrchr(target, '/');
    const char *name = slash ? slash + 1 : target;
    int n = snprintf(s->path, sizeof s->path, "%.*s.%.*s.XXXXXX", (int)(name - target), target, NAME, name);
    if (n < 0 || (size_t)n >= sizeof s->path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    for (int tries = 0; tries < 100; tries++) {
        if (random_name(s->path + n - RANDOM, RANDOM) < 0) return -1;
        if (access(s->path, F_OK) == 0) continue;
        s->pid = getpid();
        atomic_store(&s->state, LIVE);
        int fd = open(s->path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666); /* the umask applies */
        if (fd >= 0) return fd;
        atomic_store(&s->state, CLAIMED);
        if (errno != EEXIST) return -1;
    }
    errno = EEXIST;
    return -1;
}

/* What kind of target is it?  Sets target, copy and mode. */
static int look_at_target(outfile *o, const char *path, errmsg *e)
{
    if (strcmp(path, "-") == 0) {
        o->copy = 1;
        return 0;
    }
    size_t len = strlen(path);
    if (len == 0) return err_set(e, "output: expected a file name, found an empty string");
    if (path[len - 1] == '/') return err_set(e, "%s: expected a file to write to, found a folder", path);
    struct stat st;
    if (stat(path, &st) < 0) {
        if (errno != ENOENT) return err_errno(e, "%s: can't write", path);
        o->target = strdup(path);
        return o->target ? 0 : err_set(e, "%s: out of memory", path);
    }
    if (S_ISDIR(st.st_mode)) return err_set(e, "%s: expected a file to write to, found a folder", path);
    if (access(path, W_OK) < 0) return err_errno(e, "%s: can't write", path);
    if (!S_ISREG(st.st_mode)) {
        o->copy = 1;
        o->target = strdup(path);
    } else { /* through a symbolic link to the file itself, which keeps its permissions */
        o->mode = st.st_mode & 07777;
        o->target = realpath(path, NULL);
    }
    return o->target ? 0 : err_errno(e, "%s: can't write", path);
}

/* Free everything of o; the temporary file is removed unless it was renamed away. */
static void release(outfile *o, int remove_it)
{
    if (o->stream) fclose(o->stream);
    if (o->slot) {
        if (remove_it) unlink(o->slot->path);
        atomic_store(&o->slot->state, FREE);
    }
    free(o->target);
    free(o->shown);
    free(o);
}

int out_begin(outfile **out, const char *path, errmsg *e)
{
    outfile *o = calloc(1, sizeof *o);
    if (!o) return err_set(e, "%s: out of memory", path);
    o->shown = strdup(strcmp(path, "-") == 0 ? "standard output" : path);
    if (!o->shown) {
        free(o);
        return err_set(e, "%s: out of memory", path);
    }
    int fd = -1;
    if (look_at_target(o, path, e) < 0) goto fail;
    o->slot = claim();
    if (!o->slot) {
        err_set(e, "%s: expected at most %d outputs at a time", o->shown, MAX_OPEN);
        goto fail;
    }
    char spool[PATH_MAX];
    const char *beside = o->target;
    if (o->copy) {
        const char *dir = getenv("TMPDIR");
        snprintf(spool, sizeof spool, "%.4000s/output", dir && *dir ? dir : "/tmp");
        beside = spool;
    }
    fd = make_temp(o->slot, beside);
    if (fd < 0) {
        err_errno(e, "%s: can't make a temporary file for it", o->shown);
        atomic_store(&o->slot->state, FREE);
        o->slot = NULL;
        goto fail;
    }
    o->stream = fdopen(fd, "w+b");
    if (!o->stream) {
        err_errno(e, "%s: can't write", o->shown);
        close(fd);
        goto fail;
    }
    *out = o;
    return 0;
fail:
    release(o, 1);
    return -1;
}

FILE *out_stream(outfile *o)
{
    return o->stream;
}

const char *out_path(const outfile *o)
{
    return o->slot->path;
}

static int copy_all(int from, int to)
{
    char buf[1 << 16];
    for (;;) {
        ssize_t n = read(from, buf, sizeof buf);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return (int)n;
        for (ssize_t done = 0; done < n;) {
            ssize_t w = write(to, buf + done, (size_t)(n - done));
            if (w < 0 && errno != EINTR) return -1;
            if (w > 0) done += w;
        }
    }
}

/* fsync, except where the file system has no such thing. */
static int sync_file(int fd)
{
    while (fsync(fd) < 0) {
        if (errno == EINVAL || errno == ENOTSUP || errno == EROFS) return 0;
        if (errno != EINTR) return -1;
    }
    return 0;
}

static void sync_folder(const char *path)
{
    char dir[PATH_MAX];
    const char *slash = strrchr(path, '/');
    int n = slash ? snprintf(dir, sizeof dir, "%.*s", (int)(slash - path) + 1, path)
                  : snprintf(dir, sizeof dir, ".");
    if (n < 0 || (size_t)n >= sizeof dir) return;
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return;
    (void)sync_file(fd); /* the file is whole either way */
    close(fd);
}

static int copy_out(const outfile *o, int from)
{
    if (!o->target) {
        if (fflush(stdout) == EOF) return -1;
        return copy_all(from, STDOUT_FILENO);
    }
    int to = open(o->target, O_WRONLY | O_CLOEXEC);
    if (to < 0) return -1;
    int rc = copy_all(from, to);
    int code = errno;
    if (close(to) < 0 && rc == 0) return -1;
    errno = code;
    return rc;
}

int out_commit(outfile *o, errmsg *e)
{
    const char *tmp = o->slot->path;
    int fd = -1;
    errno = 0;
    int bad = ferror(o->stream);
    if (fflush(o->stream) == EOF) bad = 1;
    if (bad && errno == 0) errno = EIO;
    if (!bad) { /* by name: a library may have put another file there */
        fd = open(tmp, O_RDONLY | O_CLOEXEC);
        bad = fd < 0;
    }
    if (!bad && o->copy) {
        bad = copy_out(o, fd) < 0;
    } else if (!bad) {
        bad = (o->mode && fchmod(fd, o->mode) < 0) || sync_file(fd) < 0 || rename(tmp, o->target) < 0;
    }
    if (bad) {
        err_errno(e, "%s: can't write", o->shown);
    } else if (!o->copy) {
        sync_folder(o->target);
    }
    if (fd >= 0) close(fd);
    release(o, bad || o->copy);
    return bad ? -1 : 0;
}

void out_abort(outfile *o)
{
    if (o) release(o, 1);
}
