/* linebuf.c - see linebuf.h. */
#include "linebuf.h"

int linebuf_push(linebuf *b, unsigned char byte)
{
    if (byte == '\n' || byte == '\r') {
        if (b->n == 0) return 0;
        b->text[b->n] = 0;
        b->n = 0;
        return 1;
    }
    if (b->n == 0) b->overlong = 0;
    if (byte < 0x20 || byte >= 0x7f) return 0;
    if (b->n < LINE_MAX_BYTES) b->text[b->n++] = (char)byte;
    else b->overlong = 1;
    return 0;
}
