/* vgrbl_internal.h - between vgrbl.c (motion, real time) and vgrbl_lines.c (the line protocol). */
#ifndef VGRBL_INTERNAL_H
#define VGRBL_INTERNAL_H

#include "vgrbl.h"

void vgrbl_say(vgrbl *g, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
void vgrbl_line(vgrbl *g, char *line); /* one command line */
void vgrbl_startup_line(vgrbl *g);
void vgrbl_alarm(vgrbl *g, int number, int critical);
int vgrbl_queue(vgrbl *g, const double to[2], double feed_mm_s); /* 0 = no room */
void vgrbl_lines(vgrbl *g);                                      /* take what is in the receive buffer */

#endif
