/*
 * names.h - file names and the camera's command line, filled in for one exposure (pure).
 */
#ifndef NAMES_H
#define NAMES_H

#include "argwords.h"
#include "plan.h"

enum { NAME_ROOM = 1024, WORD_ROOM = 8192 };

/* Relative to the session's folder. */
int name_picture(char out[NAME_ROOM], const session *s, int i, int j, int k, errmsg *e);
int name_stem(const char *name); /* characters before the ending; all of them where it has none */
int name_times(char out[NAME_ROOM], const session *s, int i, int j, errmsg *e); /* "" = none wanted */

/* The camera's argument vector for exposure k at p, standing at machine position arrived (mm), to be written
 * to file.  {stem}: file without its ending.  {x} {y}: planned lengths along U and V, {ax} {ay} the same as
 * measured, {mx} {my} measured machine mm. */
int name_command(argwords *argv, const session *s, const place *p, const double arrived[2], int k,
                 const char *file, errmsg *e);

/* text filled in as a word of that command is, unquoted. */
int name_text(char out[WORD_ROOM], const session *s, const char *text, const place *p,
              const double arrived[2], int k, errmsg *e);

/* Are all names of the session fillable, inside the folder, and different? */
int names_check(const session *s, errmsg *e);

#endif
