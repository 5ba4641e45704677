/* port.c - POSIX termios behind port.h. */
#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include "deadline.h"
#include "portholder.h"
#include "signals.h"

struct port {
    int fd, is_socket;
    struct termios before;
};

static const struct {
    int baud;
    speed_t speed;
} speeds[] = {{9600, B9600},     {19200, B19200},     {38400, B38400},    {57600, B57600},
              {115200, B115200}, {230400, B230400},   {460800, B460800},  {500000, B500000},
              {921600, B921600}, {1000000, B1000000}, {2000000, B2000000}};

static int set_raw(port *p, const char *path, int baud, errmsg *warning, errmsg *e)
{
    struct termios want, have;
    speed_t speed = B0;
    for (size_t k = 0; k < sizeof speeds / sizeof speeds[0]; k++)
        if (speeds[k].baud == baud) speed = speeds[k].speed;
    if (speed == B0) return err_set(e, "%s: expected a usual baud rate, found %d", path, baud);
    want = p->before;
    cfmakeraw(&want);
    want.c_cflag &= ~(tcflag_t)(CSTOPB | PARENB | CRTSCTS | HUPCL);
    want.c_cflag |= CS8 | CREAD | CLOCAL;
    want.c_cc[VMIN] = want.c_cc[VTIME] = 0;
    cfsetispeed(&want, speed);
    cfsetospeed(&want, speed);
    if (tcsetattr(p->fd, TCSANOW, &want) != 0) return err_errno(e, "%s: serial settings", path);
    /* tcsetattr succeeds if any of it could be done: read back what was */
    if (tcgetattr(p->fd, &have) != 0) return err_errno(e, "%s: serial settings", path);
    if (have.c_lflag != want.c_lflag || have.c_iflag != want.c_iflag || have.c_oflag != want.c_oflag ||
        (have.c_cflag & CSIZE) != CS8)
        return err_set(e, "%s: the line did not take the settings 8N1, raw", path);
    if (cfgetospeed(&have) != speed) err_set(warning, "%s: the line does not run at %d baud", path, baud);
    tcflush(p->fd, TCIOFLUSH);
    return 0;
}

/* Connect to one address within the deadline. */
static int dial_one(const struct addrinfo *a, double deadline_s)
{
    int fd = socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), bad = 0, on = 1;
    socklen_t n = sizeof bad;
    if (fd < 0) return -1;
    if (connect(fd, a->ai_addr, a->ai_addrlen) != 0) {
        struct pollfd f = {.fd = fd, .events = POLLOUT};
        bad = errno;
        if (bad == EINPROGRESS) {
            int ready;
            while ((ready = poll(&f, 1, left_ms(deadline_s))) < 0 && errno == EINTR && !signals_number()) {
            }
            bad = ready > 0 ? 0 : ready == 0 ? ETIMEDOUT : errno;
            if (!bad && getsockopt(fd, SOL_SOCKET, SO_ERROR, &bad, &n) != 0) bad = errno;
        }
    }
    if (bad) {
        close(fd);
        errno = bad;
        return -1;
    }
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on); /* real-time bytes go out at once */
    setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    return fd;
}

/* tcp:HOST:PORT */
static int dial(port *p, const char *path, errmsg *e)
{
    char host[256];
    const char *at = path + 4, *colon = strrchr(at, ':');
    size_t n = colon ? (size_t)(colon - at) : 0;
    if (n > 2 && at[0] == '[' && at[n - 1] == ']') {
        at++;
        n -= 2;
    }
    if (!colon || n == 0 || n >= sizeof host || !colon[1] ||
        strspn(colon + 1, "0123456789") != strlen(colon + 1))
        return err_set(e, "%s: expected tcp:HOST:PORT", path);
    memcpy(host, at, n);
    host[n] = 0;
    struct addrinfo want = {.ai_socktype = SOCK_STREAM}, *list;
    int bad = getaddrinfo(host, colon + 1, &want, &list);
    if (bad) return err_set(e, "%s: %s", path, gai_strerror(bad));
    p->is_socket = 1;
    p->fd = -1;
    for (const struct addrinfo *a = list; a && p->fd < 0; a = a->ai_next) p->fd = dial_one(a, now_s() + 5);
    bad = p->fd < 0 ? err_errno(e, "%s", path) : 0;
    freeaddrinfo(list);
    return bad;
}

/* The far end of a pty (majors 136 to 143) is open in the program behind it. */
static int is_pty(const struct stat *st)
{
    return major(st->st_rdev) >= 136 && major(st->st_rdev) <= 143;
}

int port_open(port **out, const char *path, int baud, errmsg *warning, errmsg *e)
{
    port *p = calloc(1, sizeof *p);
    struct stat st;
    char who[128] = "";
    warning->text[0] = 0;
    if (!p) return err_set(e, "out of memory");
    if (!strncmp(path, "tcp:", 4)) {
        if (dial(p, path, e) != 0) {
            free(p);
            return -1;
        }
        *out = p;
        return 0;
    }
    p->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (p->fd < 0) {
        int why = errno;
        err_errno(e, "%s", path);
        if (why == EBUSY && port_holder(who, sizeof who, path))
            err_set(e, "%s: the port is in use by another program: %s", path, who);
        free(p);
        return -1;
    }
    int bad = 0;
    if (fstat(p->fd, &st) != 0 || !S_ISCHR(st.st_mode) || tcgetattr(p->fd, &p->before) != 0)
        bad = err_set(e, "%s: expected a serial port", path);
    else if (flock(p->fd, LOCK_EX | LOCK_NB) != 0)
        bad = err_set(e, "%s: the port is in use by another program%s%s", path,
                      port_holder(who, sizeof who, path) ? ": " : "", who);
    else if (!is_pty(&st) &&
             port_holder(who, sizeof who, path)) /* one that doesn't lock; root gets past TIOCEXCL */
        bad = err_set(e, "%s: the port is in use by another program: %s", path, who);
    else if (ioctl(p->fd, TIOCEXCL) != 0) /* keeps out those who don't lock */
        bad = err_errno(e, "%s: exclusive use", path);
    if (bad) {
        close(p->fd); /* its settings are not ours to touch */
        free(p);
        return -1;
    }
    if (set_raw(p, path, baud, warning, e) != 0) {
        port_close(p);
        return -1;
    }
    *out = p;
    return 0;
}

int port_drop_dtr(port *p, const char *path, errmsg *e)
{
    int lines = TIOCM_DTR | TIOCM_RTS;
    if (!p->is_socket && ioctl(p->fd, TIOCMBIC, &lines) == 0) return 0;
    return err_set(e, "%s: the line has no DTR to drop", path);
}

void port_close(port *p)
{
    if (!p) return;
    if (p->is_socket) {
        close(p->fd);
        free(p);
        return;
    }
    p->before.c_cflag &= ~(tcflag_t)HUPCL; /* dropping DTR would reboot the controller */
    tcsetattr(p->fd, TCSANOW, &p->before);
    ioctl(p->fd, TIOCNXCL);
    close(p->fd);
    free(p);
}

/* Wait for the events, an interrupt or the deadline. */
static port_result wait_for(port *p, short events, double deadline_s, int ignore_interrupt)
{
    struct pollfd f[2] = {{.fd = p->fd, .events = events},
                          {.fd = ignore_interrupt ? -1 : signals_fd(), .events = POLLIN}};
    for (;;) {
        int n = poll(f, 2, left_ms(deadline_s));
        signals_answer();
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return PORT_GONE;
        if (f[1].revents & POLLIN) return PORT_INTERRUPTED;
        if (f[0].revents & events) return PORT_OK;
        if (f[0].revents & (POLLHUP | POLLERR | POLLNVAL)) return PORT_GONE;
        if (n == 0) return PORT_TIMEOUT;
    }
}

port_result port_send(port *p, const void *bytes, size_t n, double deadline_s, int ignore_interrupt)
{
    const char *from = bytes;
    while (n > 0) {
        ssize_t w = p->is_socket ? send(p->fd, from, n, MSG_NOSIGNAL) : write(p->fd, from, n);
        if (w > 0) {
            from += w;
            n -= (size_t)w;
        } else if (w < 0 && errno == EINTR) {
            signals_answer();
        } else if (w == 0 || errno == EAGAIN) {
            port_result r = wait_for(p, POLLOUT, deadline_s, ignore_interrupt);
            if (r != PORT_OK) return r;
        } else {
            return PORT_GONE;
        }
    }
    return PORT_OK;
}

port_result port_receive(port *p, void *bytes, size_t room, size_t *got, double deadline_s)
{
    for (;;) {
        port_result r = wait_for(p, POLLIN, deadline_s, 0);
        if (r != PORT_OK) return r;
        ssize_t n = read(p->fd, bytes, room);
        if (n > 0) {
            *got = (size_t)n;
            return PORT_OK;
        }
        /* With VMIN = 0 no bytes may mean just that; hung up is what poll calls so.  EIO and
         * ENXIO say it themselves. */
        struct pollfd f = {.fd = p->fd, .events = POLLIN};
        if (n == 0 && !p->is_socket && poll(&f, 1, 0) >= 0 && !(f.revents & (POLLHUP | POLLERR | POLLNVAL)))
            continue;
        if (n == 0 || (errno != EINTR && errno != EAGAIN)) return PORT_GONE;
    }
}

void port_discard(port *p)
{
    char sink[256];
    while (read(p->fd, sink, sizeof sink) > 0) {
    }
}
