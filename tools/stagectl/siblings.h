/*
 * siblings.h - the files that a camera writes beside {file}: raw beside JPEG, a sidecar.
 *
 * All files of one exposure have the temporary name's stem in common (".shot-" and 16 digits, in the
 * session's folder); what follows it is a file's rest: ".nef", "-2.jpg", ".jpg.xmp".  Under its final name a
 * file is the picture's name without the ending, then its rest.
 */
#ifndef SIBLINGS_H
#define SIBLINGS_H

#include "journal.h"

/* The picture itself under its temporary name, where the camera wrote its ending in other letters' case
 * (gphoto2's %C: .JPG).  Refuses an exposure whose files are there but none with the picture's ending. */
int siblings_picture(const session *s, const char *temp, errmsg *e);

/* Find the others, whole and digested, into t->beside.  0, or -1 (t->beside then is freed). */
int siblings_find(journal_shot *t, const session *s, errmsg *e);

/* Remove all files of an exposure that failed. */
void siblings_remove(const session *s, const char *temp);

/* Temporary path and final path of one. */
int siblings_paths(char temp[4096], char path[4096], const session *s, int i, int j, int k,
                   const journal_shot *t, const journal_file *f, errmsg *e);

/* Is a file of t already there under its final name that is not one of the shot `known`? */
int siblings_are_new(const session *s, int i, int j, int k, const journal_shot *t, const journal_shot *known,
                     errmsg *e);

/* Files of `known` that t has none in the place of: they show another exposure.  Removed, and said. */
int siblings_replace(const session *s, int i, int j, int k, const journal_shot *t, const journal_shot *known,
                     void (*say)(const char *words), errmsg *e);

/* Rename them all: durable under the temporary names, they get the final ones. */
int siblings_commit(const session *s, int i, int j, int k, const journal_shot *t, errmsg *e);

#endif
