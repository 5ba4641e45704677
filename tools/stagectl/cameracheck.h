/*
 * cameracheck.h - the same picture at the same place, again: has the camera, the stage or the light moved?
 *
 * Every [camera] check_picture places, at the end, and when a session is gone on with: back to the first
 * place that is done, its exposure of most contrast twice more.  The two tell how alike pictures are that
 * should be the same (noise, flicker); the one on record against the first of them tells what has changed
 * (samepicture.h).  Both are thrown away; the result is on record.
 */
#ifndef CAMERACHECK_H
#define CAMERACHECK_H

#include "capture.h"

/* Before the first place of a run that needs the stage (begin), after each place, and after the last (end).
 * *from: where the stage comes from, at: room for where it is then.  A difference is said, with the places
 * that are in doubt, and is no error. */
stage_code camera_check(capture_run *r, const place *last, int begin, int end, double at[2],
                        const double **from, errmsg *e);

#endif
