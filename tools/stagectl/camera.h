/*
 * camera.h - runs the camera's command for one exposure and makes sure that it ends.
 */
#ifndef CAMERA_H
#define CAMERA_H

#include "argwords.h"

typedef enum camera_result {
    CAMERA_OK = 0,     /* ended with exit code 0: the file is still to be looked at */
    CAMERA_FAILED,     /* words in the errmsg */
    CAMERA_INTERRUPTED /* an unacknowledged signal; the command was ended */
} camera_result;

typedef struct camera_limits {
    double timeout_s, kill_after_s;
    const char *error_text; /* in the output: failure; "" = none */
    int log_fd;             /* gets what the command writes; opened for reading too, to quote its last line */
    int lock_fd; /* stays open in the command: whoever finds it locked knows that a camera still runs.  -1:
                    none */
} camera_limits;

/* Its own process group, no input, killed with us.  Overdue: TERM to the group, then KILL. */
camera_result camera_run(const argwords *argv, const camera_limits *l, errmsg *e);

#endif
