/* camera.c - see camera.h. */
#include "camera.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "deadline.h"
#include "leftover.h"
#include "signals.h"

extern char **environ;

/* Our environment, but messages in the C locale, and the word that marks the command's processes.  One
 * allocation, the strings are ours and the environment's own; free() it. */
static char **surroundings(const char *word)
{
    static char language[] = "LC_ALL=C";
    size_t n = 0, kept = 0;
    while (environ[n]) n++;
    char **all = calloc(n + 3, sizeof *all);
    if (!all) return NULL;
    for (size_t k = 0; k < n; k++)
        if (strncmp(environ[k], "LC_ALL=", 7) != 0 && strncmp(environ[k], "LANGUAGE=", 9) != 0 &&
            strncmp(environ[k], word, strcspn(word, "=") + 1) != 0)
            all[kept++] = environ[k];
    all[kept++] = language;
    all[kept] = (char *)(uintptr_t)word;
    return all;
}

/* In the child: nothing but async-signal-safe calls. */
static _Noreturn void become(const argwords *argv, const camera_limits *l, char *const *env, const char *word,
                             pid_t parent, int report)
{
    struct sigaction dfl = {.sa_handler = SIG_DFL};
    const int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGCONT, SIGPIPE, SIGQUIT};
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127); /* it died before the line above */
    for (size_t k = 0; k < sizeof signals / sizeof *signals; k++) sigaction(signals[k], &dfl, NULL);
    int null = open("/dev/null", O_RDONLY);
    if (null >= 0) dup2(null, 0);
    dup2(l->log_fd, 1);
    dup2(l->log_fd, 2);
    if (l->note_fd >= 0) leftover_note(l->note_fd, word);
    execvpe(argv->word[0], argv->word, env);
    int why = errno;
    if (write(report, &why, sizeof why) < 0) {
    }
    _exit(127);
}

/* Last line that the command wrote after byte `from` of the log. */
static void last_words(char out[200], int fd, off_t from)
{
    char buf[1024];
    off_t end = lseek(fd, 0, SEEK_END);
    if (end - from > (off_t)sizeof buf - 1) from = end - (off_t)sizeof buf + 1;
    ssize_t n = end > from ? pread(fd, buf, (size_t)(end - from), from) : 0;
    while (n > 0 && (buf[n - 1] == '\n' || buf[n - 1] == '\r' || buf[n - 1] == ' ')) n--;
    ssize_t start = n;
    while (start > 0 && buf[start - 1] != '\n') start--;
    snprintf(out, 200, "%.*s", n > start ? (int)(n - start) : 0, buf + start);
}

/* How often does the log hold the text after byte `from`, and where (NULL: never mind) first?  Read in pieces
 * that overlap by less than the text. */
static int said(off_t *where, int fd, off_t from, const char *text, size_t len)
{
    char buf[8192];
    size_t kept = 0;
    int times = 0;
    if (len == 0 || len >= sizeof buf / 2) return 0;
    for (ssize_t n; (n = pread(fd, buf + kept, sizeof buf - kept, from)) > 0; from += n) {
        size_t have = kept + (size_t)n;
        char *at = buf;
        for (char *hit; (hit = memmem(at, have - (size_t)(at - buf), text, len)); at = hit + len)
            if (times++ == 0 && where) *where = from - (off_t)kept + (hit - buf);
        kept = have - (size_t)(at - buf) < len ? have - (size_t)(at - buf) : len - 1;
        memmove(buf, buf + have - kept, kept);
    }
    return times;
}

/* 200 bytes of the log from there on as one line. */
static void words_at(char out[200], int fd, off_t at)
{
    char buf[200];
    ssize_t n = pread(fd, buf, sizeof buf - 1, at);
    size_t k = 0;
    for (ssize_t i = 0; i < n; i++) {
        const int blank = (unsigned char)buf[i] <= ' ';
        if (!blank || (k > 0 && out[k - 1] != ' ')) out[k++] = blank ? ' ' : buf[i];
    }
    while (k > 0 && out[k - 1] == ' ') k--;
    out[k] = 0;
}

/* The first of the texts parted by | that the log holds after byte `from`: its length, or 0. */
static int said_one_of(const char **which, off_t *where, int fd, off_t from, const char *texts)
{
    for (const char *p = texts; *p;) {
        p += strspn(p, " |");
        size_t len = strcspn(p, "|"), whole = len;
        while (len > 0 && p[len - 1] == ' ') len--;
        *which = p;
        if (said(where, fd, from, p, len)) return (int)len;
        p += whole;
    }
    return 0;
}

/* Exit code 0: what do its words say? */
static camera_result judge_words(const camera_limits *l, off_t from, const char *last, errmsg *e)
{
    const char *text;
    char words[200];
    off_t where = from;
    int len = said_one_of(&text, &where, l->log_fd, from, l->error_text), saved;
    words_at(words, l->log_fd, where);
    if (len > 0) err_set(e, "camera: it said '%.*s': %s", len, text, words);
    else if (l->expect_text[0] && !said(NULL, l->log_fd, from, l->expect_text, strlen(l->expect_text)))
        err_set(e, "camera: expected it to say '%s', its last line is '%s'", l->expect_text, last);
    else if (l->saves_one && (saved = said(NULL, l->log_fd, from, "Saving file as ", 15)) > 1)
        err_set(
            e,
            "camera: it saved %d files under one name, each over the one before (raw and JPEG?): expected "
            "--filename {stem}.%%C",
            saved);
    else return CAMERA_OK;
    return CAMERA_FAILED;
}

/* Wait until the process has ended (not reaped yet), an interrupt, or the deadline: 1, -1, 0. */
static int wait_end(int pidfd, double deadline, int heed_interrupt)
{
    for (;;) {
        struct pollfd f[2] = {{.fd = pidfd, .events = POLLIN},
                              {.fd = heed_interrupt ? signals_fd() : -1, .events = POLLIN}};
        int n = poll(f, 2, left_ms(deadline));
        signals_answer();
        if (n < 0 && errno == EINTR) continue;
        if (f[0].revents) return 1;
        if (f[1].revents) return -1;
        if (n <= 0) return 0;
    }
}

static int start(pid_t *pid, int *pidfd, const argwords *argv, const camera_limits *l, errmsg *e)
{
    int report[2], why = 0;
    char word[LEFTOVER_WORD];
    pid_t parent = getpid();
    if (pipe2(report, O_CLOEXEC) != 0) return err_errno(e, "camera");
    leftover_word(word);
    char **env = surroundings(word);
    *pid = env ? fork() : -1;
    if (*pid == 0) become(argv, l, env, word, parent, report[1]);
    int forked = errno;
    free(env);
    close(report[1]);
    if (*pid < 0) {
        close(report[0]);
        errno = forked;
        return err_errno(e, "camera");
    }
    setpgid(*pid, *pid); /* whoever is first; the group is there before any kill */
    *pidfd = (int)syscall(SYS_pidfd_open, *pid, 0);
    ssize_t n;
    while ((n = read(report[0], &why, sizeof why)) < 0 && errno == EINTR) {
    }
    close(report[0]);
    if (n == (ssize_t)sizeof why || *pidfd < 0) {
        int no_pidfd = *pidfd < 0 ? errno : 0;
        kill(*pid, SIGKILL);
        while (waitpid(*pid, NULL, 0) < 0 && errno == EINTR) {
        }
        if (*pidfd >= 0) close(*pidfd);
        errno = n == (ssize_t)sizeof why ? why : no_pidfd;
        return err_errno(e, "camera: %s", argv->word[0]);
    }
    return 0;
}

camera_result camera_run(const argwords *argv, const camera_limits *l, errmsg *e)
{
    pid_t pid = -1;
    int pidfd = -1, status = 0;
    char words[200];
    off_t log_from = lseek(l->log_fd, 0, SEEK_END);
    if (start(&pid, &pidfd, argv, l, e) != 0) return CAMERA_FAILED;
    int ended = wait_end(pidfd, now_s() + l->timeout_s, 1), reason = ended;
    if (ended != 1) {
        kill(-pid, SIGTERM);
        ended = wait_end(pidfd, now_s() + l->kill_after_s, 0);
    }
    kill(-pid, SIGKILL); /* it, or what it has left behind: nothing of it may run while the stage moves */
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    close(pidfd);
    if (reason == -1) {
        err_set(e, "interrupted while exposing");
        return CAMERA_INTERRUPTED;
    }
    last_words(words, l->log_fd, log_from);
    if (reason == 0)
        err_set(e, "camera: not done after %g s, %s%s%s", l->timeout_s, ended == 1 ? "ended" : "killed",
                words[0] ? ": " : "", words);
    else if (WIFSIGNALED(status))
        err_set(e, "camera: ended by signal %d%s%s", WTERMSIG(status), words[0] ? ": " : "", words);
    else if (WEXITSTATUS(status) != 0)
        err_set(e, "camera: exit code %d%s%s", WEXITSTATUS(status), words[0] ? ": " : "", words);
    else return judge_words(l, log_from, words, e);
    return CAMERA_FAILED;
}
