/*
 * camerawords.h - what a session can tell of its camera: the options in a virtualcamera's command, lens and
 * field of view.
 *
 * Each fact has one source.  {plane}, {lens} and {fov} carry the session's into the command and into [chain];
 * where the command of a virtualcamera or the options of fishremap say the same a second time, they have to
 * agree.
 */
#ifndef CAMERAWORDS_H
#define CAMERAWORDS_H

#include "argwords.h"
#include "session.h"

enum { FILLED_ROOM = 8192 };

extern const char camera_default_lens[]; /* virtualcamera's */
extern const double camera_default_fov;  /* degrees */

/* The command's words as run for the first exposure of the first node, without sh -c. */
int camera_words(argwords *words, const session *s, errmsg *e);

/* Does the command run virtualcamera (whatever its folder and PROGRAM_PREFIX)? */
int camera_is_virtual(const argwords *words);

/* Is one of its words this program (whatever its folder)? */
int camera_runs(const argwords *words, const char *program);

/* Value of a long option, written --name VALUE or --name=VALUE or shortened, or of -l VALUE; NULL = not
 * there. */
const char *option_value(const argwords *words, const char *name, char letter);

/* Lens and field of view (degrees): as [camera] says, else the virtual camera's, else equidistant, 185.  The
 * lens points into the words or the session. */
void camera_lens(const char **lens, double *fov, const session *s, const argwords *words);

/* text with {plane}, {lens} and {fov} filled in; other braces stay. */
int session_fill(char out[FILLED_ROOM], const session *s, const char *text, errmsg *e);

/* [chain] fishremap, filled in, with --lens and --fov added where it leaves them out. */
int session_fishremap(char out[FILLED_ROOM], const session *s, errmsg *e);

/* Nine numbers in the fewest digits that give them back; out: 9 * 26. */
void plane_text(char out[256], const double plane[9]);

/* Do command, [grid], [camera] and [chain] agree? */
int camera_agrees(const session *s, errmsg *e);

#endif
