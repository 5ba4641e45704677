/* files.c - see files.h. */
#include "files.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int files_join(char *out, unsigned room, const char *folder, const char *name, errmsg *e)
{
    int n = snprintf(out, room, "%s/%s", folder, name);
    return n > 0 && (unsigned)n < room ? 0 : err_set(e, "%s: the name is too long", name);
}

int files_make_parents(const char *path, errmsg *e)
{
    char part[4096];
    size_t n = strlen(path);
    if (n >= sizeof part) return err_set(e, "%s: the name is too long", path);
    memcpy(part, path, n + 1);
    for (char *p = part + 1; *p; p++) {
        if (*p != '/') continue;
        *p = 0;
        if (mkdir(part, 0777) == 0) {
            if (files_sync_parent(part, e) != 0) return -1;
        } else if (errno != EEXIST) {
            return err_errno(e, "%s", part);
        }
        *p = '/';
    }
    return 0;
}

int files_sync(const char *path, errmsg *e)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return err_errno(e, "%s", path);
    int bad = fsync(fd) != 0 ? err_errno(e, "%s", path) : 0;
    close(fd);
    return bad;
}

int files_sync_parent(const char *path, errmsg *e)
{
    char dir[4096];
    const char *slash = strrchr(path, '/');
    if (!slash) return files_sync(".", e);
    snprintf(dir, sizeof dir, "%.*s", slash == path ? 1 : (int)(slash - path), path);
    return files_sync(dir, e);
}
