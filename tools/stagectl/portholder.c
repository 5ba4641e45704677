/* portholder.c - see portholder.h. */
#include "portholder.h"

#include <ctype.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

static void name_of(char *out, size_t room, long pid)
{
    char path[64], name[64] = "";
    snprintf(path, sizeof path, "/proc/%ld/comm", pid);
    FILE *f = fopen(path, "r");
    if (f) {
        if (fgets(name, sizeof name, f)) name[strcspn(name, "\n")] = 0;
        fclose(f);
    }
    snprintf(out, room, "%s (pid %ld)", name[0] ? name : "another program", pid);
}

/* Does a process have the very device open? */
static int has_open(long pid, const struct stat *device)
{
    char folder[64], path[400];
    struct dirent *d;
    struct stat st;
    int found = 0;
    snprintf(folder, sizeof folder, "/proc/%ld/fd", pid);
    DIR *fds = opendir(folder);
    if (!fds) return 0;
    while (!found && (d = readdir(fds))) {
        if (!isdigit((unsigned char)d->d_name[0])) continue;
        snprintf(path, sizeof path, "%s/%s", folder, d->d_name);
        found = stat(path, &st) == 0 && S_ISCHR(st.st_mode) && st.st_rdev == device->st_rdev;
    }
    closedir(fds);
    return found;
}

/* The lock's owner; /proc/locks: "1: FLOCK ADVISORY WRITE PID MAJOR:MINOR:INODE 0 EOF", device in hex. */
static long lock_owner(const struct stat *file)
{
    char line[256];
    long pid, found = 0;
    unsigned major_no, minor_no;
    unsigned long inode;
    FILE *f = fopen("/proc/locks", "r");
    if (!f) return 0;
    while (!found && fgets(line, sizeof line, f))
        if (sscanf(line, "%*s %*s %*s %*s %ld %x:%x:%lu", &pid, &major_no, &minor_no, &inode) == 4 &&
            pid > 0 && inode == (unsigned long)file->st_ino && major_no == major(file->st_dev) &&
            minor_no == minor(file->st_dev))
            found = pid;
    fclose(f);
    return found;
}

int port_holder(char *out, size_t room, const char *path)
{
    struct stat device;
    struct dirent *d;
    if (stat(path, &device) != 0 || !S_ISCHR(device.st_mode)) return 0;
    long self = (long)getpid(), who = lock_owner(&device);
    DIR *all = who > 0 && who != self ? NULL : opendir("/proc");
    if (all) who = 0;
    while (all && !who && (d = readdir(all))) {
        long pid = strtol(d->d_name, NULL, 10);
        if (pid > 0 && pid != self && has_open(pid, &device)) who = pid;
    }
    if (all) closedir(all);
    if (who <= 0 || who == self) return 0;
    name_of(out, room, who);
    return 1;
}
