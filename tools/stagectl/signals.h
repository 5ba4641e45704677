/*
 * signals.h - SIGINT and SIGTERM as something that poll() can wait for, SIGCONT as a question.
 *
 * The first SIGINT or SIGTERM makes every wait end early; the program then tells the stage to
 * hold.  A second one cuts the holding short.  SIGCONT asks for one status line.
 */
#ifndef SIGNALS_H
#define SIGNALS_H

void signals_install(void (*status_line)(void)); /* status_line: called outside the handler; may be NULL */
int signals_fd(void);                            /* readable while an interrupt waits to be acknowledged */
int signals_number(void);                        /* signal of the unacknowledged interrupt, 0 = none */
void signals_acknowledge(void);                  /* from now on only a further one counts */
int signals_first(void);           /* signal of the first interrupt ever, 0 = none: exit code 128 + it */
int signals_pause(double seconds); /* 0, or -1: an interrupt is there to be acknowledged */
void signals_answer(void);         /* print the status line if one was asked for; after each EINTR */

#endif
