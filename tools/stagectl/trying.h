/*
 * trying.h - --keep-trying: a session that goes on by itself after the camera or the stage has failed.
 *
 * Worth another try: a camera whose retries are used up, a stage that is unplugged, silent or (thrice without
 * an exposure in between) says no.  Not worth it: what another try can't change (plan, files, travel), and an
 * interrupt.  The rests grow from 1 s to 60 s and begin anew with each exposure taken.
 */
#ifndef TRYING_H
#define TRYING_H

#include "capture.h"

/* After an end with code and words: 1 = rested, try again; 0 = that is the end (e may be other words then).
 * *code becomes STAGE_INTERRUPTED if the rest was interrupted.  The stage is still or closed. */
int trying_again(capture_run *r, stage_code *code, errmsg *e);

/* The name under which to open the stage's port.  Once it was open that is its name in /dev/serial/by-id,
 * where it has one: a device that is plugged in again may be another /dev/ttyUSB. */
const char *trying_port(const capture_run *r);
void trying_port_open(capture_run *r); /* it is open: remember that, and its lasting name */

#endif
