/*
 * rounds.h - between two rounds of an adaptive capture: the chain works on what is there and says where the
 * stage goes next.
 */
#ifndef ROUNDS_H
#define ROUNDS_H

#include "session.h"
#include "stage.h"

/* Run [chain] next, which may put nodes on the session's list, and read the list again.  *more: nodes that came.
 * What it prints goes to chain.log in the folder, its last line to say.  A list that lacks what was there is
 * refused: what was captured stays captured. */
stage_code rounds_next(long *more, session *s, const char *path, void (*say)(const char *words), errmsg *e);

/* The command, as the session says or make with the rules beside this program; 0 or -1. */
int rounds_command(char out[8192], const session *s, const char *path, errmsg *e);

#endif
