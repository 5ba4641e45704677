/*
 * virtualstage.c - a stage on a pseudo-terminal: for the digital twin and for tests.
 *
 * The controllers are pure (vgrbl.c, vc4.c) and live in simulated time; this file is their clock, their wire
 * with its faults, and the socket that tells where the stage truly stands.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

#include "base/cli.h"
#include "stagectl/deadline.h"
#include "vc4.h"
#include "vgrbl.h"

static struct {
    const char *dialect, *link, *truth, *fault, *startup;
    double factor, travel[2], steps[2], rate, acceleration, home_rate, start[2], offset[2], late_ok, boot;
    int inches, work, no_homing, hard, no_soft, with_parent, split, noise, skip_status, c4, home_direction,
        reset_ok, deaf, idle_delay, z_first, single_axis;
} o = {.dialect = "grbl",
       .factor = 1,
       .idle_delay = 255,
       .travel = {800, 800},
       .steps = {80, 80},
       .rate = 6000,
       .acceleration = 200,
       .home_rate = 1500,
       .start = {-123.4, -234.5}};

static int take_pair(const char *value, void *arg, errmsg *e)
{
    return cli_parse_doubles(arg, 2, value, ",", e);
}

static const cli_opt opts[] = {
    {"dialect", 0, CLI_STRING, &o.dialect, NULL, "NAME", "grbl (default), grblhal or c4"},
    {"link", 0, CLI_STRING, &o.link, NULL, "PATH", "symbolic link to the terminal; removed at the end"},
    {"truth", 0, CLI_STRING, &o.truth, NULL, "PATH",
     "socket: whoever connects is told 'X Y SPEED' in true mm and mm/s"},
    {"time-factor", 0, CLI_DOUBLE, &o.factor, NULL, "F", "the stage's seconds in one of ours (1)"},
    {"travel", 0, CLI_CALL, o.travel, take_pair, "X,Y", "length of the axes, mm (800,800)"},
    {"steps", 0, CLI_CALL, o.steps, take_pair, "X,Y", "steps/mm (80,80)"},
    {"max-rate", 0, CLI_DOUBLE, &o.rate, NULL, "F", "fastest of each axis, mm/min (6000)"},
    {"acceleration", 0, CLI_DOUBLE, &o.acceleration, NULL, "A", "of each axis, mm/s2 (200)"},
    {"home-rate", 0, CLI_DOUBLE, &o.home_rate, NULL, "F", "homing speed, mm/min (1500)"},
    {"home-direction", 0, CLI_INT, &o.home_direction, NULL, "BITS",
     "$23: axes that home at their low end (0)"},
    {"start", 0, CLI_CALL, o.start, take_pair, "X,Y", "true position at power-up, mm from the switches"},
    {"work-offset", 0, CLI_CALL, o.offset, take_pair, "X,Y", "G54, mm (0,0)"},
    {"startup", 0, CLI_STRING, &o.startup, NULL, "LINE", "$N0: line run at start and after homing, e.g. G20"},
    {"inches", 0, CLI_FLAG, &o.inches, NULL, NULL, "$13=1: reports in inches"},
    {"work-positions", 0, CLI_FLAG, &o.work, NULL, NULL, "$10=0: reports WPos"},
    {"no-homing", 0, CLI_FLAG, &o.no_homing, NULL, NULL, "$22=0"},
    {"no-soft-limits", 0, CLI_FLAG, &o.no_soft, NULL, NULL, "$20=0"},
    {"hard-limits", 0, CLI_FLAG, &o.hard, NULL, NULL, "$21=1: the ends of travel raise ALARM:1"},
    {"idle-delay", 0, CLI_INT, &o.idle_delay, NULL, "MS",
     "$1: after a move the motors keep their current so long; 255 = always (255)"},
    {"z-first", 0, CLI_FLAG, &o.z_first, NULL, NULL,
     "$H looks for a Z axis first and fails, as stock GRBL on two axes"},
    {"single-axis", 0, CLI_FLAG, &o.single_axis, NULL, NULL, "take $HX and $HY"},
    {"skip-status", 0, CLI_INT, &o.skip_status, NULL, "N", "answer one status query in N"},
    {"late-ok", 0, CLI_DOUBLE, &o.late_ok, NULL, "S", "each ok comes so much later, s of ours"},
    {"reset-ok", 0, CLI_FLAG, &o.reset_ok, NULL, NULL, "a reset answers a pending command before the banner"},
    {"boot", 0, CLI_DOUBLE, &o.boot, NULL, "S", "deaf and dumb for so long, then the banner, s of ours"},
    {"deaf", 0, CLI_FLAG, &o.deaf, NULL, NULL, "never answer anything"},
    {"split", 0, CLI_FLAG, &o.split, NULL, NULL, "hand out single bytes, 1 ms apart"},
    {"noise", 0, CLI_FLAG, &o.noise, NULL, NULL, "bytes of noise and lines of nonsense between the lines"},
    {"with-parent", 0, CLI_FLAG, &o.with_parent, NULL, NULL, "end when the process that started it ends"},
    {"fault", 0, CLI_STRING, &o.fault, NULL, "KIND@N",
     "in move N: alarm1 alarm3 error9 reboot silence unplug slip hold door sleep check\ngarble stray"},
    {0}};

static const cli_choice choices[] = {
    {"dialect", "grbl grblhal c4"},
    {0},
};

static const cli_prog prog = {.name = "virtualstage",
                              .operands = "[--link PATH]",
                              .summary = "Answer as a stage's controller on a pseudo-terminal.",
                              .opts = opts,
                              .choices = choices,
                              .epilog =
                                  "The terminal's name is printed on standard output.  Ends on SIGTERM."};

typedef struct chunk {
    double due;
    char byte[16];
    int n;
} chunk;

static struct {
    vgrbl g;
    vc4 c;
    int master, slave, truth_fd;
    double began;
    chunk queue[4096];
    size_t head, tail; /* ring */
    unsigned noise;
} v;

static volatile sig_atomic_t ended;

static void on_end(int sig)
{
    (void)sig;
    ended = 1;
}

static void parse_fault(vgrbl_settings *s)
{
    static const char *const names[] = {"",     "alarm1", "alarm3", "error9", "reboot", "silence", "unplug",
                                        "slip", "hold",   "door",   "sleep",  "check",  "garble",  "stray"};
    char kind[32], rest;
    if (!o.fault) return;
    if (sscanf(o.fault, "%31[a-z0-9]@%ld%c", kind, &s->fault_at, &rest) == 2 && s->fault_at > 0)
        for (int k = 1; k < (int)(sizeof names / sizeof *names); k++)
            if (!strcmp(kind, names[k])) s->fault = (vgrbl_fault)k;
    if (s->fault == FAULT_NONE) cli_fail(CLI_USAGE, "--fault: expected KIND@N, found '%s'", o.fault);
}

/* Simulated time now. */
static double sim(void)
{
    return (now_s() - v.began) * o.factor;
}

static void enqueue(const char *bytes, int n, double due)
{
    chunk *c = &v.queue[v.tail % 4096];
    if (v.tail - v.head == 4096 || n < 1 || n > (int)sizeof c->byte) return;
    memcpy(c->byte, bytes, (size_t)n);
    c->n = n;
    c->due = due;
    v.tail++;
}

static void make_noise(double due)
{
    static const char *const junk[] = {"\x80\xff", "\x00\x01", "}x#|\r\n", "\xfe<Idl\r\n", "[\r\n", "\r\r\n"};
    v.noise = v.noise * 1664525 + 1013904223;
    const char *j = junk[(v.noise >> 16) % 6];
    enqueue(j, j[0] == 0 ? 2 : (int)strlen(j), due);
}

/* From the controller's output to the wire: its lines in order, each when it is due. */
static void collect(void)
{
    char *out = o.c4 ? v.c.out : v.g.out;
    size_t n = o.c4 ? v.c.out_n : v.g.out_n;
    static double last;
    double now = now_s();
    for (size_t at = 0; at < n;) {
        char *end = memchr(out + at, '\n', n - at);
        size_t len = end ? (size_t)(end - out) + 1 - at : n - at;
        int is_ok = len >= 2 && !strncmp(out + at, "ok", 2);
        last = fmax(last, now + (is_ok ? o.late_ok : 0));
        if (o.noise) make_noise(last);
        size_t step = o.split ? 1 : sizeof v.queue->byte;
        for (size_t k = 0; k < len; k += step) {
            if (o.split) last += 0.001;
            enqueue(out + at + k, (int)(len - k < step ? len - k : step), last);
        }
        at += len;
    }
    if (o.c4) v.c.out_n = 0;
    else v.g.out_n = 0;
}

static void flush_wire(void)
{
    while (v.head < v.tail) {
        chunk *c = &v.queue[v.head % 4096];
        if (c->due > now_s() + 1e-4) return;
        if (!o.deaf && write(v.master, c->byte, (size_t)c->n) < 0 && errno == EAGAIN) return;
        v.head++;
    }
}

static void tell_truth(void)
{
    char line[128];
    double xy[2], speed = 0;
    int fd = accept(v.truth_fd, NULL, NULL), moving = 0;
    if (fd < 0) return;
    if (o.c4) {
        vc4_truth(&v.c, xy, &moving);
        for (int a = 0; a < 2; a++) xy[a] /= o.steps[a];
        speed = moving;
    } else vgrbl_truth(&v.g, xy, &speed);
    int n = snprintf(line, sizeof line, "%.6f %.6f %.6f\n", xy[0], xy[1], speed);
    if (write(fd, line, (size_t)n) < 0) {
    }
    close(fd);
}

static void open_truth(void)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    v.truth_fd = -1;
    if (!o.truth) return;
    if (strlen(o.truth) >= sizeof a.sun_path)
        cli_fail(CLI_FAILED, "%s: the name is too long for a socket", o.truth);
    strcpy(a.sun_path, o.truth);
    unlink(o.truth);
    v.truth_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (v.truth_fd < 0 || bind(v.truth_fd, (struct sockaddr *)&a, sizeof a) != 0 ||
        listen(v.truth_fd, 16) != 0)
        cli_fail(CLI_FAILED, "%s: %s", o.truth, strerror(errno));
}

static void open_line(void)
{
    char name[128];
    struct termios t;
    if (openpty(&v.master, &v.slave, name, NULL, NULL) != 0)
        cli_fail(CLI_FAILED, "no pseudo-terminal: %s", strerror(errno));
    tcgetattr(v.slave, &t);
    cfmakeraw(&t);
    tcsetattr(v.slave, TCSANOW, &t);
    fcntl(v.master, F_SETFL, O_NONBLOCK);
    if (o.link) {
        unlink(o.link);
        if (symlink(name, o.link) != 0) cli_fail(CLI_FAILED, "%s: %s", o.link, strerror(errno));
    }
    printf("%s\n", name);
    fflush(stdout);
}

static void start_controller(void)
{
    int hal = !strcmp(o.dialect, "grblhal");
    o.c4 = !strcmp(o.dialect, "c4");
    if (!o.c4 && !hal && strcmp(o.dialect, "grbl") != 0)
        cli_fail(CLI_USAGE, "--dialect: expected grbl, grblhal or c4, found '%s'", o.dialect);
    if (!(o.factor > 0 && o.rate > 0 && o.acceleration > 0 && o.home_rate > 0 && o.steps[0] > 0 &&
          o.steps[1] > 0))
        cli_fail(CLI_USAGE, "expected factor, rates, acceleration and steps above 0");
    vgrbl_settings s = {.steps_per_mm = {o.steps[0], o.steps[1]},
                        .max_rate = {o.rate, o.rate},
                        .acceleration = {o.acceleration, o.acceleration},
                        .travel = {o.travel[0], o.travel[1]},
                        .inches = o.inches,
                        .work_positions = o.work,
                        .homing = !o.no_homing,
                        .soft_limits = !o.no_soft && !o.no_homing,
                        .hard_limits = o.hard,
                        .home_direction = o.home_direction,
                        .hal = hal,
                        .idle_delay = o.idle_delay,
                        .z_first = o.z_first,
                        .single_axis = o.single_axis,
                        .home_rate = o.home_rate,
                        .offset = {o.offset[0], o.offset[1]},
                        .startup = o.startup,
                        .skip_status = o.skip_status,
                        .late_ok = o.reset_ok};
    parse_fault(&s);
    vgrbl_init(&v.g, &s, o.start);
    const long at[2] = {lround(o.start[0] * o.steps[0]), lround(o.start[1] * o.steps[1])};
    vc4_init(&v.c, at, o.rate / 60 * o.steps[0]);
}

/* Milliseconds until something is due: output, or an event of the controller. */
static int wait_ms(int booted)
{
    double due = v.head < v.tail ? v.queue[v.head % 4096].due : INFINITY;
    double event = o.c4 ? vc4_next(&v.c) : vgrbl_next(&v.g);
    if (isfinite(event)) due = fmin(due, v.began + event / o.factor);
    if (!booted) due = fmin(due, v.began + o.boot);
    return isfinite(due) ? left_ms(due) : 200;
}

static void serve(void)
{
    unsigned char in[256];
    int booted = 0;
    v.began = now_s();
    while (!ended && !v.g.unplugged) {
        if (!booted && now_s() >= v.began + o.boot) {
            booted = 1;
            if (!o.c4) vgrbl_power_up(&v.g);
        }
        if (o.c4) vc4_advance(&v.c, sim());
        else vgrbl_advance(&v.g, sim());
        collect();
        flush_wire();
        struct pollfd f[2] = {{.fd = v.master, .events = POLLIN}, {.fd = v.truth_fd, .events = POLLIN}};
        /* A pty, unlike a port, keeps the exclusive mark of an owner that was killed. */
        if (poll(f, 2, wait_ms(booted)) == 0) ioctl(v.slave, TIOCNXCL);
        if (o.c4) vc4_advance(&v.c, sim());
        else vgrbl_advance(&v.g, sim());
        if (f[1].revents & POLLIN) tell_truth();
        ssize_t n = f[0].revents & POLLIN ? read(v.master, in, sizeof in) : 0;
        for (ssize_t k = 0; booted && k < n; k++) {
            if (o.c4) vc4_byte(&v.c, in[k]);
            else vgrbl_byte(&v.g, in[k]);
        }
    }
}

int main(int argc, char **argv)
{
    if (cli_parse(&prog, argc, argv) > 0) cli_fail(CLI_USAGE, "expected options only, found '%s'", argv[1]);
    struct sigaction a = {.sa_handler = on_end};
    sigaction(SIGTERM, &a, NULL);
    sigaction(SIGINT, &a, NULL);
    if (o.with_parent) prctl(PR_SET_PDEATHSIG, SIGTERM);
    start_controller();
    open_truth();
    open_line();
    serve();
    if (o.link) unlink(o.link);
    if (o.truth) unlink(o.truth);
    return cli_end(CLI_OK);
}
