/*
 * session.h - SESSION.conf: what is captured, where, with what.
 *
 * Every key is a row of one table (session_keys) that drives parsing, checking, `stagectl keys`, the
 * identity of a plan and the man page's test.  Unknown keys are refused.
 */
#ifndef SESSION_H
#define SESSION_H

#include <stddef.h>

#include "base/errmsg.h"
#include "exposures.h"

typedef enum capture_order { ORDER_SERPENTINE, ORDER_RASTER } capture_order;
typedef enum picture_check { CHECK_DECODE, CHECK_SIZE } picture_check;
typedef enum times_source { TIMES_ASKED, TIMES_EXIF } times_source;
typedef enum fail_action { FAIL_STOP, FAIL_SKIP } fail_action;

typedef struct session {
    /* [grid] */
    int nodes[2];           /* along u, v */
    double plane[9];        /* O U V, scene units */
    int order;              /* capture_order */
    char *positions;        /* "all", "adaptive", or a list of nodes (positions.h) */
    int positions_most;     /* adaptive: at most so many; 0 = 5/8 of the nodes */
    double positions_error; /* adaptive: enough, when light from above is as certain as this */
    int (*listed)[2];       /* nodes i, j to visit, in order; NULL = all */
    long n_listed;
    /* [stage] */
    char *driver, *port;    /* port "" = not given */
    double unit_mm;         /* mm per scene unit */
    double origin[2];       /* machine mm of the plane's corner O */
    char *axes;             /* "x y", "-x y", "y x" ... */
    int axis[2], sign[2];   /* from axes: machine axis along u, v and its direction */
    double feed;            /* mm/min */
    double settle;          /* s */
    double backlash[2];     /* mm; final approach of each axis in the direction of the sign */
    int home;               /* 1: home first; 0: the stage's zero is right */
    double travel[4];       /* x lo, x hi, y lo, y hi in mm; all 0 = what the controller says */
    double steps_per_mm[2]; /* 0 = what the controller says */
    double home_timeout;    /* s; 0 = as the controller's settings say */
    char *homing;           /* commands that home it */
    int check_home;         /* home and compare every so many places; 0 = only at the start */
    int baud, dtr;          /* 0 = the driver's; 1 = as opened */
    double acceleration;    /* mm/s2, for the plan's times; 0 = not known */
    /* [camera] */
    char *command;
    char *depends; /* files, by their contents part of the plan; "auto", "none" */
    char *lens;    /* "" = as the command says, else virtualcamera's default */
    double fov;    /* degrees; 0 = likewise */
    int shell;
    char *labels;      /* a word for each exposure, {label}; "" = none */
    char *error_text;  /* in the command's output it means failure; "" = none; "auto" is replaced by the
                          command's kind's */
    char *expect_text; /* that the command has to print, with {label}...; "" = none */
    double timeout;    /* s beyond the exposure; 0 in the file is replaced by the camera's kind's */
    double kill_after; /* s from TERM to KILL */
    int retries;
    double retry_wait;                    /* s before each */
    int on_fail;                          /* fail_action: when the retries are used up */
    int list_times;                       /* times_source: what stands in the list for hdrgen */
    double time_tolerance, f_number, iso; /* what pictures may say of themselves (asked.h) */
    char *exposures_text;
    double exposure[EXPOSURES_MAX]; /* s, rising */
    int exposures;
    int adaptive;
    double clip_share, black_share; /* shares of the pixels in the image circle that may clip, be black */
    double clip_level, black_level; /* of the highest code */
    double circle;     /* radius of the image circle over half the picture's height; 0 = whole picture */
    int check;         /* picture_check */
    int check_picture; /* places between looks at whether the camera still sees the same; 0 = never */
    double check_difference; /* share of the contrast by which it may differ */
    double overhead;         /* s per exposure besides the exposure, for the plan's times */
    double file_mb;          /* expected size of a file, for the plan's space */
    /* [output] */
    char *folder, *file, *times;
    int repeat_points;
    char *home_folder; /* of the session file: "" or ending in / */
    /* [chain] for scenes/capture.mk; stagectl only checks it */
    char *before, *beside, *hdrgen, *fishremap, *ilfpack, *ilflamps, *light_field, *next;
} session;

/* Where a session stands in the plan's identity: resumed only if these are what they were. */
typedef struct session_key {
    const char *section, *name;
    int kind;           /* session_keys.c's own */
    size_t offset;      /* of the member in session */
    double least, most; /* numbers */
    const char *preset; /* default as text; NULL = must be given */
    int identity;       /* part of the plan's identity; 2: where the camera's command has it in braces */
    const char *help;
} session_key;

extern const session_key session_keys[]; /* ended by name == NULL */

/* Read and check.  The folder is taken relative to the session file's place. */
int session_load(session *s, const char *path, errmsg *e);
void session_free(session *s);

/* Value of a key in one canonical way of writing; room >= 4096. */
void session_value(char *out, size_t room, const session *s, const session_key *k);

#endif
