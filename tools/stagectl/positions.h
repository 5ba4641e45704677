/*
 * positions.h - the nodes of the grid that a session visits, where these are not all: [grid] positions.
 *
 * A list has a line "I J" for each node, in the order of the visit; lines that begin with # are comments.
 * Adaptive sessions keep theirs in their folder, as positions.txt: it begins with a coarse grid and grows by
 * whole rounds (rounds.h).  The nodes visited are no part of the plan's identity: what a journal has of other
 * nodes stays.
 */
#ifndef POSITIONS_H
#define POSITIONS_H

#include "session.h"

/* 1: the list grows during the capture. */
int positions_adaptive(const session *s);

/* Fill s->listed from the list, or by the coarse grid where an adaptive session has none yet.  Refuses what is
 * no list of different nodes. */
int positions_load(session *s, errmsg *e);

/* Where the list is; room for 4096. */
int positions_path(char path[4096], const session *s, errmsg *e);

/* Write the list of an adaptive session, if it is not there.  The folder is. */
int positions_begin(const session *s, errmsg *e);

/* Begin again with the coarse grid: the list on disk is removed. */
int positions_anew(session *s, errmsg *e);

/* How many an adaptive session may visit, unless it says so itself: 5/8 of all nodes. */
long positions_most(const session *s);

#endif
