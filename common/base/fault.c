#include "fault.h"

#include <signal.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

#include "outfile.h"

#define MOST 8 /* objects at a time: a program has two or three fields open */

static struct {
    const void *object[MOST];
    fault_words *words[MOST];
    const char *program;
    struct sigaction before;
    int caught;
} watch;

static const char *find_words(const void *address)
{
    for (int k = 0; k < MOST; k++) {
        const char *words = watch.object[k] ? watch.words[k](watch.object[k], address) : NULL;
        if (words) return words;
    }
    return NULL;
}

static void on_fault(int signo, siginfo_t *info, void *context)
{
    const char *words = find_words(info->si_addr);
    const char *const parts[] = {watch.program, ": ", words, "\n"};
    char line[1024];
    size_t n = 0;

    (void)context;
    if (!words) { /* not ours: whoever had the signal before gets it again */
        sigaction(signo, &watch.before, NULL);
        return;
    }
    for (size_t k = 0; k < sizeof parts / sizeof *parts; k++)
        for (const char *c = parts[k]; *c && n < sizeof line; c++) line[n++] = *c;
    (void)!write(STDERR_FILENO, line, n);
    out_cleanup();
    _exit(1);
}

static void catch_faults(void)
{
    struct sigaction act;

    memset(&act, 0, sizeof act);
    act.sa_sigaction = on_fault;
    act.sa_flags = SA_SIGINFO;
    sigaction(SIGBUS, &act, &watch.before);
    watch.caught = 1;
}

void fault_watch(const char *program, const void *object, fault_words *words)
{
    watch.program = program;
    for (int k = 0; k < MOST; k++)
        if (!watch.object[k]) {
            watch.words[k] = words, watch.object[k] = object;
            break;
        }
    if (!watch.caught) catch_faults();
}

void fault_forget(const void *object)
{
    for (int k = 0; k < MOST; k++)
        if (watch.object[k] == object) watch.object[k] = NULL;
}
