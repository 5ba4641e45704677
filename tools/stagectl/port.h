/*
 * port.h - a serial line, or a connection to a controller on the network, with deadlines, for one program at
 * a time.
 *
 * Bytes in, bytes out; what they mean is the driver's.  Every wait has a deadline (deadline.h) and
 * ends early for an interrupt (signals.h).
 */
#ifndef PORT_H
#define PORT_H

#include <stddef.h>

#include "base/errmsg.h"

typedef struct port port;

typedef enum port_result {
    PORT_OK = 0,
    PORT_TIMEOUT,    /* deadline passed */
    PORT_GONE,       /* unplugged, hung up */
    PORT_INTERRUPTED /* SIGINT or SIGTERM, not acknowledged yet */
} port_result;

/* path: a serial port, or tcp:HOST:PORT ([HOST] for IPv6) for controllers on the network, which has no speed.
 * A serial port is exclusive (flock, then TIOCEXCL: root may pass the latter), raw, 8N1, no modem lines, no
 * HUPCL.  What the line can't do (a pty has no baud rate) comes back as words in *warning, else it is empty.
 */
int port_open(port **p, const char *path, int baud, errmsg *warning, errmsg *e);

/* Drop DTR and RTS.  -1 with words where the line has none. */
int port_drop_dtr(port *p, const char *path, errmsg *e);

/* Restores the line's settings.  NULL is allowed. */
void port_close(port *p);

/* All n bytes, or the reason why not.  ignore_interrupt: for what must go out after one. */
port_result port_send(port *p, const void *bytes, size_t n, double deadline_s, int ignore_interrupt);

/* What there is, at least one byte: *got of at most room. */
port_result port_receive(port *p, void *bytes, size_t room, size_t *got, double deadline_s);

/* Throw away what has come in and not been read. */
void port_discard(port *p);

#endif
