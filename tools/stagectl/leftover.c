/* leftover.c - see leftover.h. */
#include "leftover.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

static const char prefix[] = "STAGECTL_COMMAND=";

void leftover_word(char word[LEFTOVER_WORD])
{
    uint64_t number = 0;
    if (getrandom(&number, sizeof number, 0) != (ssize_t)sizeof number)
        number = (uint64_t)time(NULL) << 24 ^ (uint64_t)getpid();
    snprintf(word, LEFTOVER_WORD, "%s%016" PRIx64, prefix, number);
}

void leftover_note(int fd, const char *word)
{
    char line[24 + LEFTOVER_WORD], digits[16];
    size_t n = 0, k = 0;
    for (long pid = getpid(); pid > 0; pid /= 10) digits[k++] = (char)('0' + pid % 10);
    while (k > 0) line[n++] = digits[--k];
    line[n++] = ' ';
    for (const char *p = word; *p && n < sizeof line - 1; p++) line[n++] = *p;
    line[n++] = '\n';
    if (ftruncate(fd, 0) != 0 || pwrite(fd, line, n, 0) != (ssize_t)n) {
    } /* on a full disk the camera's own file will fail */
}

/* A small file of /proc, as far as it fits. */
static ssize_t slurp(char *out, size_t room, const char *pid, const char *file)
{
    char path[300];
    snprintf(path, sizeof path, "/proc/%s/%s", pid, file);
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return -1;
    size_t got = 0;
    for (ssize_t n; got < room - 1 && (n = read(fd, out + got, room - 1 - got)) > 0;) got += (size_t)n;
    close(fd);
    out[got] = 0;
    return (ssize_t)got;
}

/* Living process of the group?  The name stands in brackets in /proc/PID/stat, behind it state, parent,
 * group. */
static int in_group(const char *pid, long group, char *name, size_t room)
{
    char stat[512], state;
    long parent, its;
    if (slurp(stat, sizeof stat, pid, "stat") <= 0) return 0;
    char *open = strchr(stat, '('), *end = strrchr(stat, ')');
    if (!open || !end || sscanf(end + 1, " %c %ld %ld", &state, &parent, &its) != 3) return 0;
    snprintf(name, room, "%.*s", (int)(end - open - 1), open + 1);
    return its == group && state != 'Z' && state != 'X';
}

/* Has its environment the word?  One that can't be read (another user's) may. */
static int has_word(const char *pid, const char *word)
{
    enum { MOST = 1 << 18 };
    char *block = malloc(MOST);
    ssize_t n = block ? slurp(block, MOST, pid, "environ") : -1;
    int has = n <= 0 || memmem(block, (size_t)n, word, strlen(word)) != NULL;
    free(block);
    return has;
}

pid_t leftover_find(int fd, char *name, size_t room)
{
    char line[24 + LEFTOVER_WORD] = {0}, word[LEFTOVER_WORD];
    long group;
    if (pread(fd, line, sizeof line - 1, 0) <= 0 || sscanf(line, "%ld %39s", &group, word) != 2) return 0;
    if (group <= 1 || strncmp(word, prefix, sizeof prefix - 1) != 0) return 0;
    if (kill((pid_t)-group, 0) != 0 && errno == ESRCH) return 0;
    DIR *d = opendir("/proc");
    pid_t found = 0;
    for (struct dirent *f; d && !found && (f = readdir(d));)
        if (isdigit((unsigned char)f->d_name[0]) && in_group(f->d_name, group, name, room) &&
            has_word(f->d_name, word))
            found = (pid_t)strtol(f->d_name, NULL, 10);
    if (d) closedir(d);
    return found;
}

pid_t leftover_owner(int fd)
{
    char line[32] = {0};
    long pid = 0;
    if (pread(fd, line, sizeof line - 1, 0) <= 0 || sscanf(line, "%ld", &pid) != 1 || pid <= 1) return 0;
    return kill((pid_t)pid, 0) == 0 || errno == EPERM ? (pid_t)pid : 0;
}
