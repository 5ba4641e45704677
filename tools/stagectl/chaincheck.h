/*
 * chaincheck.h - are the options in [chain] right?  Asked of the programs themselves, before hours of
 * capture.
 */
#ifndef CHAINCHECK_H
#define CHAINCHECK_H

#include "session.h"

/* Runs hdrgen, fishremap and ilfpack (and ilflamps, where it has options) of this installation with the session's options and --dry-run, in the
 * session file's folder and through a shell as the rules do.  words: what was checked.  -1 with the program's
 * own words. */
int chain_check(char words[256], const session *s, errmsg *e);

#endif
