/*
 * notes.h - what was assumed about a series and the user should know: one line each on stderr.
 */
#ifndef HDRGEN_NOTES_H
#define HDRGEN_NOTES_H

#include "job.h"

void notes_exposures(const job *j); /* times, ISO, f-number */
void notes_colours(const job *j);   /* white balance, matrix, gamut */
void notes_turn(const job *j);      /* orientation */
void notes_flare(const job *j);     /* what the lens scattered, and what became of it */

/* -v: what was used for each image. */
void report_shots(const job *j);

#endif
