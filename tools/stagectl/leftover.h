/*
 * leftover.h - is a camera command that a killed run has left behind still at work?
 *
 * No lock answers that: what a child inherits, a server that the command leaves running (adb does) keeps for
 * ever.  So the command itself notes its process group and a word that only its environment has, in a file of
 * the session's folder; whoever comes later looks in /proc for a process that is in that group and has the
 * word.  A server has gone to a group of its own (setsid), and is not waited for; a group's number that is
 * somebody else's by now lacks the word.
 */
#ifndef LEFTOVER_H
#define LEFTOVER_H

#include <stddef.h>
#include <sys/types.h>

enum { LEFTOVER_WORD = 40 };

/* The variable of the command's environment, "STAGECTL_COMMAND=...". */
void leftover_word(char word[LEFTOVER_WORD]);

/* In the child, before it becomes the command: note group and word in fd.  Async-signal-safe. */
void leftover_note(int fd, const char *word);

/* A process of the group noted in fd that is still there, and its name; 0: none. */
pid_t leftover_find(int fd, char *name, size_t room);

/* The number of the process that a lock file names; 0: none, or it is gone. */
pid_t leftover_owner(int fd);

#endif
