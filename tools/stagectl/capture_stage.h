/*
 * capture_stage.h - the stage's side of a session: made ready before the first move, looked after on the way,
 * left standing at the end.
 */
#ifndef CAPTURE_STAGE_H
#define CAPTURE_STAGE_H

#include "capture.h"

/* Connect, compare with the journal, check every point against the travel, home or take the position as it
 * is. */
stage_code capture_ready_stage(capture_run *r, errmsg *e);

/* Look where the homing switches are, home, and say what has drifted: the places from r->doubt_from to the
 * one of that index are in doubt then. */
stage_code capture_check_home(capture_run *r, long index, errmsg *e);

/* After an end before its time: the stage must not go on moving.  What the session ended for stays the
 * reason. */
void capture_leave_stage(capture_run *r, stage_code why);

#endif
