/* chaincheck.c - see chaincheck.h. */
#include "chaincheck.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "argwords.h"
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

/* In the child: program with words in folder home, what it says into `to`. */
static _Noreturn void become(const char *home, const char *program, char *const *words, int to)
{
    int null = open("/dev/null", O_RDWR | O_CLOEXEC);
    if (null >= 0 && chdir(home[0] ? home : ".") == 0 && dup2(null, 0) == 0 && dup2(null, 1) == 1 &&
        dup2(to, 2) == 2)
        execv(program, words);
    _exit(127);
}

/* Its exit status, and the first line that it says; -1: it could not be run. */
static int ask(char line[512], const char *home, const char *program, char *const *words, errmsg *e)
{
    int ends[2], status = 0;
    line[0] = 0;
    if (pipe2(ends, O_CLOEXEC) != 0) return err_errno(e, "%s", program);
    pid_t child = fork();
    if (child == 0) become(home, program, words, ends[1]);
    close(ends[1]);
    FILE *f = child > 0 ? fdopen(ends[0], "r") : NULL;
    if (!f) {
        int rc = err_errno(e, "%s", program);
        close(ends[0]);
        return rc;
    }
    if (fgets(line, 512, f)) line[strcspn(line, "\n")] = 0;
    for (char more[512]; fgets(more, sizeof more, f);) {
    }
    fclose(f);
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

/* Does a shell, which make gives them to, make something else of these words than argwords.h does? */
static int wants_shell(const char *options)
{
    return options[strcspn(options, "$`*?[~;&|<>(){}!#\n")] != 0;
}

enum { STEPS = 4 };
static const char *const STEP[STEPS] = {"hdrgen", "fishremap", "ilfpack", "ilflamps"};

/* The options of each step, and what the rules add to them; without options there is no ilflamps. */
static int fill(char options[STEPS][FILLED_ROOM], char rest[STEPS][512], const session *s, errmsg *e)
{
    char plane[256];

    if (session_fill(options[0], s, s->hdrgen, e) != 0 || session_fishremap(options[1], s, e) != 0 ||
        session_fill(options[2], s, s->ilfpack, e) != 0 || session_fill(options[3], s, s->ilflamps, e) != 0)
        return -1;
    plane_text(plane, s->plane);
    snprintf(rest[0], sizeof rest[0], "-o fisheye.exr picture");
    snprintf(rest[1], sizeof rest[1], "-o probe.exr fisheye.exr");
    snprintf(rest[2], sizeof rest[2], "--grid %dx%d --plane '%s' -o room.ilf.exr probe.exr", s->nodes[0],
             s->nodes[1], plane);
    snprintf(rest[3], sizeof rest[3], "-o lamps.ilf.exr room.ilf.exr");
    return 0;
}

/* 0 if the program takes them. */
static int check_step(const char *home, const char *program, const char *name, const char *options,
                      const char *rest, errmsg *e)
{
    argwords w;
    char *all = NULL, line[512];

    if (asprintf(&all, "%s --dry-run %s %s", name, options, rest) < 0) return err_set(e, "out of memory");
    int bad = argwords_split(&w, all, e), status = bad ? -1 : ask(line, home, program, w.word, e);
    if (!bad) argwords_free(&w);
    free(all);
    if (status <= 0) return status;
    return err_set(e, "[chain] %s: %s", name, line[0] ? line : "its options are refused without words");
}

int chain_check(char words[256], const session *s, errmsg *e)
{
    char program[PATH_MAX], options[STEPS][FILLED_ROOM], rest[STEPS][512];

    snprintf(words, 256, "options of hdrgen, fishremap%s are right",
             s->ilflamps[0] ? ", ilfpack and ilflamps" : " and ilfpack");
    if (fill(options, rest, s, e) != 0) return -1;
    for (int k = 0; k < (s->ilflamps[0] ? STEPS : STEPS - 1); k++) {
        if (!sibling(program, STEP[k])) {
            snprintf(words, 256, "options not checked: %s is not beside this program", STEP[k]);
            return 0;
        }
        if (wants_shell(options[k])) {
            snprintf(words, 256, "options of %s not checked: they need a shell", STEP[k]);
            continue;
        }
        if (check_step(s->home_folder, program, STEP[k], options[k], rest[k], e) != 0) return -1;
    }
    return 0;
}
