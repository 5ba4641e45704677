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
    const char *error_text;  /* in the output: failure; texts parted by |; "" = none */
    const char *expect_text; /* missing from the output: failure; "" = none */
    int saves_one; /* it is gphoto2, which says of each file that it saves it, and has one name for all */
    int log_fd;    /* gets what the command writes; opened for reading too, to quote its last line */
    int note_fd;   /* gets its process group (leftover.h); -1: none */
} camera_limits;

/* Its own process group, no input, the messages' language C (LC_ALL=C: error_text must not depend on the
 * user's), no descriptor of ours but the log; killed with us.  Overdue: TERM to the group, then KILL. */
camera_result camera_run(const argwords *argv, const camera_limits *l, errmsg *e);

#endif
