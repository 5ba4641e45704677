/*
 * linebuf.h - lines out of a stream of bytes (pure).
 *
 * A line ends at '\n' or '\r', however many; empty lines are passed over.  Bytes that no controller
 * sends (NUL, other control characters, 0x80 and up) are line noise and dropped.  What is longer
 * than a line can be is cut and marked.
 */
#ifndef LINEBUF_H
#define LINEBUF_H

#include <stddef.h>

enum { LINE_MAX_BYTES = 256 };

typedef struct linebuf {
    char text[LINE_MAX_BYTES + 1];
    size_t n;
    int overlong;
} linebuf;

/* Take one byte.  Returns 1 when text holds a whole line (NUL-terminated; overlong lines come as
 * their first LINE_MAX_BYTES bytes); the next call starts the next line. */
int linebuf_push(linebuf *b, unsigned char byte);

#endif
