/*
 * field_guard.h - for programs: when the file of a light field in use is cut short, end with words and exit
 * status 1.
 *
 * Texels that are used in place lie in the mapped file; where that ends before the map does, the system sends
 * SIGBUS.  What happens then must be safe in a signal handler: one write, and _exit.
 */
#ifndef FIELD_GUARD_H
#define FIELD_GUARD_H

#include <signal.h>
#include <string.h>
#include <unistd.h>

#include "base/outfile.h"
#include "ilf.h"

static struct field_guard {
    const ilf *field;
    const char *prog;
    struct sigaction before;
} field_guard;

static void field_guard_caught(int signo, siginfo_t *info, void *context)
{
    const char *words = ilf_fault(field_guard.field, info->si_addr);
    const char *const parts[] = {field_guard.prog, ": ", words, "\n"};
    char line[1024];
    size_t n = 0;

    (void)context;
    if (!words) { /* not ours: whoever had the signal before gets it again */
        sigaction(signo, &field_guard.before, NULL);
        return;
    }
    for (size_t k = 0; k < sizeof parts / sizeof *parts; k++)
        for (const char *c = parts[k]; *c && n < sizeof line; c++) line[n++] = *c;
    (void)!write(STDERR_FILENO, line, n);
    out_cleanup();
    _exit(1);
}

/* Call once the field is open; it must stay open. */
static void field_guard_begin(const ilf *field, const char *prog)
{
    struct sigaction act;

    field_guard.field = field;
    field_guard.prog = prog;
    memset(&act, 0, sizeof act);
    act.sa_sigaction = field_guard_caught;
    act.sa_flags = SA_SIGINFO;
    sigaction(SIGBUS, &act, &field_guard.before);
}

#endif
