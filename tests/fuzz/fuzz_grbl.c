/*
 * fuzz_grbl.c - everything that a stage may say, to the drivers as a whole: connect, home, move, ask, halt.
 *
 * The port is replaced by one whose answers are the input; the clock by one that moves on by itself, so
 * that waits cost nothing.  First byte: which driver, and how much comes at a time.
 */
#include <math.h>
#include <signal.h>
#include <sys/syscall.h>
#include <time.h>

#include "fuzz.h"
#include "stagectl/c4_proto.h"
#include "stagectl/grbl_proto.h"
#include "stagectl/linebuf.h"
#include "stagectl/stage.h"

struct port {
    const uint8_t *at, *end;
    size_t piece;
};
static struct port the_port;
static double the_time;
static int fake_time; /* the fuzzer wants the true one */
static long asked;

int clock_gettime(clockid_t id, struct timespec *t)
{
    if (!fake_time) return (int)syscall(SYS_clock_gettime, id, t);
    HOLDS(++asked < 10000000); /* or it would wait for ever */
    the_time += 1e-3;
    t->tv_sec = (time_t)the_time;
    t->tv_nsec = (long)((the_time - (double)t->tv_sec) * 1e9);
    return 0;
}

int nanosleep(const struct timespec *t, struct timespec *left)
{
    if (!fake_time) return (int)syscall(SYS_nanosleep, t, left);
    the_time += (double)t->tv_sec + 1e-9 * (double)t->tv_nsec;
    return 0;
}

int port_open(port **p, const char *path, int baud, errmsg *warning, errmsg *e)
{
    (void)path, (void)baud, (void)e;
    warning->text[0] = 0;
    *p = &the_port;
    return 0;
}

int port_drop_dtr(port *p, const char *path, errmsg *e)
{
    (void)p;
    return err_set(e, "%s: no such lines", path);
}

void port_close(port *p)
{
    (void)p;
}

port_result port_send(port *p, const void *bytes, size_t n, double deadline_s, int ignore_interrupt)
{
    (void)p, (void)bytes, (void)deadline_s, (void)ignore_interrupt;
    HOLDS(n > 0 && n <= 128);
    return PORT_OK;
}

port_result port_receive(port *p, void *bytes, size_t room, size_t *got, double deadline_s)
{
    size_t n = (size_t)(p->end - p->at);

    if (n == 0) { /* nothing more to come: a silence, and in the end the plug */
        if (the_time > 100) return PORT_GONE;
        the_time = fmax(the_time, deadline_s) + 1;
        return PORT_TIMEOUT;
    }
    if (n > p->piece) n = p->piece;
    if (n > room) n = room;
    if (*p->at == 0xff) { /* a pause */
        p->at++;
        the_time = fmax(the_time, deadline_s) + .01;
        return PORT_TIMEOUT;
    }
    memcpy(bytes, p->at, n);
    p->at += n;
    *got = n;
    return PORT_OK;
}

void port_discard(port *p)
{
    if (p->at < p->end) p->at++;
}

static void lines(const uint8_t *data, size_t size)
{
    linebuf b = {0};

    for (size_t k = 0; k < size; k++) {
        grbl_message m;
        if (!linebuf_push(&b, data[k])) continue;
        HOLDS(strlen(b.text) <= LINE_MAX_BYTES);
        grbl_parse(&m, b.text);
        HOLDS(m.axes >= 0 && m.axes <= GRBL_AXES && (m.kind != GRBL_SETTING || isfinite(m.value)));
        for (int a = 0; a < GRBL_AXES; a++) HOLDS(isfinite(m.pos[a]) && isfinite(m.offset[a]));
        HOLDS(grbl_error_words(m.number)[0] && grbl_alarm_words(m.number)[0] && grbl_state_name(m.state)[0]);
    }
}

static void talk(const uint8_t *data, size_t size)
{
    static const double path[2][2] = {{-10, -20}, {-30.5, -40.25}};
    stage s = {.home_timeout_s = 5, .stated_steps_per_mm = {80, 80}};
    errmsg e = {""};
    double xy[2];
    char state[32];

    the_time = 0;
    the_port = (struct port){data + 1, data + size, 1 + (data[0] >> 1 & 63)};
    stage_code r = stage_open(&s, data[0] & 1 ? &stage_driver_c4 : &stage_driver_grbl, "port", &e);
    if (r != STAGE_OK) {
        one_line(e.text);
        return;
    }
    for (int a = 0; a < 2; a++)
        HOLDS(isfinite(s.facts.steps_per_mm[a]) && isfinite(s.facts.lo[a]) && isfinite(s.facts.hi[a]));
    if (data[0] & 128) r = s.driver->home(&s, &e);
    if (r == STAGE_OK) r = s.driver->go(&s, path, 2, 600, .1, &e);
    if (r == STAGE_OK) r = s.driver->where(&s, xy, state, &e);
    if (r == STAGE_OK) HOLDS(isfinite(xy[0]) && isfinite(xy[1]));
    if (r == STAGE_OK) r = s.driver->check(&s, &e);
    if (r != STAGE_OK) one_line(e.text);
    e.text[0] = 0;
    if (s.driver->halt(&s, &e) != STAGE_OK) one_line(e.text);
    stage_close(&s);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 1) return 0;
    lines(data + 1, size - 1);
    sigset_t alarm, before; /* the fuzzer's alarm would read the false clock */
    sigemptyset(&alarm);
    sigaddset(&alarm, SIGALRM);
    sigprocmask(SIG_BLOCK, &alarm, &before);
    fake_time = 1;
    asked = 0;
    talk(data, size);
    fake_time = 0;
    sigprocmask(SIG_SETMASK, &before, NULL);
    return 0;
}
