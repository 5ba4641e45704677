/* signals.c - the self-pipe behind signals.h. */
#include "signals.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stddef.h>
#include <unistd.h>

#include "deadline.h"

static volatile sig_atomic_t first, pending, asked;
static int wake[2] = {-1, -1};
static void (*answer)(void);

static void on_signal(int sig)
{
    int saved = errno;
    if (sig == SIGCONT) {
        asked = 1;
    } else {
        if (!first) first = sig;
        pending = sig;
        if (write(wake[1], "", 1) < 0) {
        } /* a full pipe is as awake as can be */
    }
    errno = saved;
}

void signals_install(void (*status_line)(void))
{
    struct sigaction a = {.sa_handler = on_signal};
    answer = status_line;
    if (pipe2(wake, O_CLOEXEC | O_NONBLOCK) != 0) return;
    sigemptyset(&a.sa_mask);
    sigaction(SIGINT, &a, NULL);
    sigaction(SIGTERM, &a, NULL);
    struct sigaction hup;
    if (sigaction(SIGHUP, NULL, &hup) == 0 && hup.sa_handler != SIG_IGN) /* nohup stays nohup */
        sigaction(SIGHUP, &a, NULL);
    sigaction(SIGCONT, &a, NULL);
}

int signals_fd(void)
{
    return wake[0];
}

int signals_number(void)
{
    return pending;
}

int signals_first(void)
{
    return first;
}

void signals_acknowledge(void)
{
    char sink[64];
    pending = 0;
    while (read(wake[0], sink, sizeof sink) > 0) {
    }
}

int signals_pause(double seconds)
{
    const double until = now_s() + seconds;
    struct pollfd f = {.fd = wake[0], .events = POLLIN};
    for (;;) {
        if (pending) return -1;
        int n = poll(&f, 1, left_ms(until));
        signals_answer();
        if (n == 0 || (n < 0 && errno != EINTR)) return pending ? -1 : 0;
    }
}

void signals_answer(void)
{
    if (!asked) return;
    asked = 0;
    if (answer) answer();
}
