/*
 * fault.h - when a file that is used where it lies (mapped) is cut short, end in one line and exit status 1.
 *
 * Where a mapped file ends before its map does, the system sends SIGBUS to whoever reads there.  What happens then
 * must be safe in a signal handler: one write, temporary outputs removed (outfile.h), and _exit.
 */
#ifndef FAULT_H
#define FAULT_H

/* What to say if the address lies in the object's map, or NULL.  Async-signal-safe; the text lives as long as the object. */
typedef const char *fault_words(const void *object, const void *address);

/* Watch over an object until fault_forget (before it is freed).  A handful at most, from one thread at a time; more are
 * not watched. */
void fault_watch(const char *program, const void *object, fault_words *words);
void fault_forget(const void *object);

#endif
