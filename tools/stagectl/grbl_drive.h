/*
 * grbl_drive.h - between the files of the GRBL driver: grbl.c (who is there), grbl_move.c (moves),
 * grbl_home.c (homing, alarms, switches).
 */
#ifndef GRBL_DRIVE_H
#define GRBL_DRIVE_H

#include "grbl_talk.h"

/* As the driver's go, home, unlock and find_switches (stage.h). */
stage_code grbl_go(stage *s, const double (*path)[2], int n, double feed, double settle_s, errmsg *e);
stage_code grbl_home(stage *s, errmsg *e);
stage_code grbl_unlock(stage *s, errmsg *e);
stage_code grbl_find_switches(stage *s, double seen[2], int found[2], errmsg *e);

#endif
