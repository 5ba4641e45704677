/* rounds.c - see rounds.h. */
#include "rounds.h"

#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "camera.h"
#include "camerawords.h"
#include "files.h"
#include "positions.h"

/* Where the rules are, from the program's folder: in the source tree, and installed. */
static const char *const RULES[] = {"/../../scenes/capture.mk", "/../share/ilf/chain/capture.mk",
                                    "/../../../share/ilf/chain/capture.mk", NULL};

static int find_rules(char out[PATH_MAX], errmsg *e)
{
    char own[PATH_MAX], beside[PATH_MAX + 64];
    ssize_t n = readlink("/proc/self/exe", own, sizeof own - 1);
    own[n > 0 ? n : 0] = 0;
    char *slash = strrchr(own, '/');
    if (slash) *slash = 0;
    for (int k = 0; RULES[k]; k++) {
        snprintf(beside, sizeof beside, "%s%s", own, RULES[k]);
        if (realpath(beside, out)) return 0;
    }
    return err_set(e, "[chain] next: expected a command: capture.mk is not beside this program (%s)", own);
}

int rounds_command(char out[8192], const session *s, const char *path, errmsg *e)
{
    char rules[PATH_MAX], whole[PATH_MAX];
    if (s->next[0])
        return snprintf(out, 8192, "%s", s->next) < 8192 ? 0 : err_set(e, "[chain] next: too long");
    if (!realpath(path, whole)) return err_errno(e, "%s", path);
    if (find_rules(rules, e) != 0) return -1;
    if (strpbrk(rules, " \t'\"$\\") || strpbrk(whole, " \t'\"$\\"))
        return err_set(e, "[chain] next: expected names free of blanks, found %s and %s", rules, whole);
    const int n =
        snprintf(out, 8192, "make -s --no-print-directory -f %s CAPTURE=%s ROUND=1 next", rules, whole);
    return n < 8192 ? 0 : err_set(e, "[chain] next: too long");
}

/* The last line of the log from byte `from` on. */
static void last_line(char out[400], int fd, off_t from)
{
    char buf[2048];
    const off_t end = lseek(fd, 0, SEEK_END);
    if (end - from > (off_t)sizeof buf - 1) from = end - (off_t)sizeof buf + 1;
    ssize_t n = end > from ? pread(fd, buf, (size_t)(end - from), from) : 0;
    while (n > 0 && (buf[n - 1] == '\n' || buf[n - 1] == ' ')) n--;
    ssize_t start = n;
    while (start > 0 && buf[start - 1] != '\n') start--;
    snprintf(out, 400, "%.*s", n > start ? (int)(n - start) : 0, buf + start);
}

/* As the camera's command is run: in a group of its own that a later run would wait for, ended with us.  The session's own line
 * goes to a shell in its folder; ours, whose names have no blanks, is run as it stands. */
static stage_code carry_out(const session *s, const char *command, int log, int note, errmsg *e)
{
    char shell[] = "sh", c[] = "-c", folder[] = "cd \"$1\" && eval \"$2\"", name[] = "sh";
    char *home = strdup(s->home_folder[0] ? s->home_folder : "."), *text = strdup(command);
    char *words[] = {shell, c, folder, name, home, text, NULL};
    argwords argv = {6, words}, split = {0};
    const camera_limits l = {1e6, s->kill_after, "", "", 0, log, note};
    errmsg why;
    int bad = home && text ? 0 : err_set(&why, "out of memory");
    if (!bad && !s->next[0]) bad = argwords_split(&split, command, &why), argv = split;
    camera_result r = bad ? CAMERA_FAILED : camera_run(&argv, &l, &why);
    argwords_free(&split);
    free(home), free(text);
    if (r == CAMERA_OK) return STAGE_OK;
    if (r == CAMERA_INTERRUPTED) err_set(e, "interrupted while the chain was at work");
    else
        err_set(e, "[chain] next: %s (%s/chain.log)",
                strncmp(why.text, "camera: ", 8) ? why.text : why.text + 8, s->folder);
    return r == CAMERA_INTERRUPTED ? STAGE_INTERRUPTED : STAGE_FAILED;
}

static int open_in(const session *s, const char *name, int flags, errmsg *e)
{
    char path[4096];
    if (files_join(path, sizeof path, s->folder, name, e) != 0) return -1;
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | flags, 0666);
    if (fd < 0) err_errno(e, "%s", path);
    return fd;
}

static stage_code run_next(const session *s, const char *path, void (*say)(const char *), errmsg *e)
{
    char command[8192], words[400];
    stage_code c = STAGE_FAILED;
    if (rounds_command(command, s, path, e) != 0) return c;
    int log = open_in(s, "chain.log", O_APPEND, e), note = log >= 0 ? open_in(s, ".camera", 0, e) : -1;
    if (note >= 0) {
        const off_t from = lseek(log, 0, SEEK_END);
        c = carry_out(s, command, log, note, e);
        last_line(words, log, from);
        if (c == STAGE_OK && words[0] && say) say(words);
    }
    if (log >= 0) close(log);
    if (note >= 0) close(note);
    return c;
}

/* Every node of the old list is where it was. */
static int begins_with(const session *s, const int (*was)[2], long n)
{
    return s->n_listed >= n && !memcmp(s->listed, was, (size_t)n * sizeof *was);
}

stage_code rounds_next(long *more, session *s, const char *path, void (*say)(const char *), errmsg *e)
{
    const long n = s->n_listed;
    int(*was)[2] = malloc((size_t)n * sizeof *was);
    *more = 0;
    if (!was) return err_set(e, "out of memory"), STAGE_FAILED;
    memcpy(was, s->listed, (size_t)n * sizeof *was);
    stage_code c = run_next(s, path, say, e);
    if (c == STAGE_OK && positions_load(s, e) != 0) c = STAGE_FAILED;
    if (c == STAGE_OK && !begins_with(s, (const int(*)[2])was, n)) {
        err_set(e, "%s/positions.txt: expected the %ld nodes that were there first, found another list",
                s->folder, n);
        c = STAGE_FAILED;
    }
    if (c == STAGE_OK) *more = s->n_listed - n;
    free(was);
    return c;
}
