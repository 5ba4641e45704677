/*
 * portholder.h - who has a port open, as far as /proc tells: processes of other users show only to root.
 */
#ifndef PORTHOLDER_H
#define PORTHOLDER_H

#include <stddef.h>

/* "NAME (pid N)" of another process that has the device open, or that holds its lock.  1, or 0: none seen. */
int port_holder(char *out, size_t room, const char *path);

#endif
