/* chaincheck.c - see chaincheck.h. */
#include "chaincheck.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "camerawords.h"

/* PREFIX/bin/PREFIX-stagectl -> PREFIX/bin/PREFIX-name, if it is there. */
static int sibling(char out[PATH_MAX], const char *name)
{
    static const char own[] = "stagectl";
    ssize_t n = readlink("/proc/self/exe", out, PATH_MAX - 32);
    const ssize_t len = sizeof own - 1;
    if (n < len || strncmp(out + n - len, own, (size_t)len) != 0) return 0;
    strcpy(out + n - len, name);
    return access(out, X_OK) == 0;
}

/* In single quotes for sh; malloc'd. */
static char *quoted(const char *s)
{
    char *out = malloc(4 * strlen(s) + 3), *p = out;
    if (!out) return NULL;
    *p++ = '\'';
    for (; *s; s++) {
        if (*s == '\'') p = stpcpy(p, "'\\'");
        *p++ = *s;
    }
    strcpy(p, "'");
    return out;
}

/* Its exit status, and the first line that it says. */
static int ask(char line[512], const char *home, const char *program, const char *options, const char *rest,
               errmsg *e)
{
    char *at = quoted(home[0] ? home : "."), *run = quoted(program), *command = NULL;
    FILE *f = NULL;
    line[0] = 0;
    if (at && run &&
        asprintf(&command, "cd %s && exec %s %s --dry-run %s 2>&1 >/dev/null </dev/null", at, run, options,
                 rest) < 0)
        command = NULL;
    if (command) f = popen(command, "r");
    free(at);
    free(run);
    free(command);
    if (!f) return err_set(e, "out of memory");
    if (fgets(line, 512, f)) line[strcspn(line, "\n")] = 0;
    for (char more[512]; fgets(more, sizeof more, f);) {
    }
    int status = pclose(f);
    return status != -1 && WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

int chain_check(char words[256], const session *s, errmsg *e)
{
    char program[PATH_MAX], options[3][FILLED_ROOM], rest[3][512], line[512], plane[256];
    static const char *const name[3] = {"hdrgen", "fishremap", "ilfpack"};
    snprintf(words, 256, "options of hdrgen, fishremap and ilfpack are right");
    if (session_fill(options[0], s, s->hdrgen, e) != 0 || session_fishremap(options[1], s, e) != 0 ||
        session_fill(options[2], s, s->ilfpack, e) != 0)
        return -1;
    plane_text(plane, s->plane);
    snprintf(rest[0], sizeof rest[0], "-o fisheye.exr picture");
    snprintf(rest[1], sizeof rest[1], "-o probe.exr fisheye.exr");
    snprintf(rest[2], sizeof rest[2], "--grid %dx%d --plane '%s' -o room.ilf.exr probe.exr", s->nodes[0],
             s->nodes[1], plane);
    for (int k = 0; k < 3; k++) {
        if (!sibling(program, name[k])) {
            snprintf(words, 256, "options not checked: %s is not beside this program", name[k]);
            return 0;
        }
        int status = ask(line, s->home_folder, program, options[k], rest[k], e);
        if (status < 0) return -1;
        if (status != 0)
            return err_set(e, "[chain] %s: %s", name[k],
                           line[0] ? line : "its options are refused without words");
    }
    return 0;
}
