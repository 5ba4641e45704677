/*
 * textfile.h - small text files of numbers: whole file, lines without comments, numbers of a line.
 */
#ifndef TEXTFILE_H
#define TEXTFILE_H

#include <stddef.h>

#include "errmsg.h"

/* Whole file as one string (malloc'd; refuses more than 16 MB and zero bytes). */
int text_read(char **text, const char *path, errmsg *e);

typedef struct textlines {
    const char *next;
    int number; /* of the line last given, from 1 */
} textlines;

textlines textlines_of(const char *text);

/* Next line that is not empty once "#..." and outer blanks are gone; 0 at the end.  What is longer than
 * room - 1 is cut, and then ends in '~', which is part of no number. */
int textlines_next(char *line, size_t room, textlines *t);

/* Numbers of a line, separated by blanks, commas or semicolons: how many there are, or -1 when
 * something is not a finite number or there are more than max. */
int text_numbers(double *v, int max, const char *line);

#endif
