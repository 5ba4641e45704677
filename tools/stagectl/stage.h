/*
 * stage.h - a stage of two axes behind a table of functions.
 *
 * Positions are machine coordinates in mm, x then y; feeds mm/min; times s.  Every call returns
 * STAGE_OK or the exit code that fits, with words in the errmsg.
 */
#ifndef STAGE_H
#define STAGE_H

#include "errmsg.h"
#include "port.h"

typedef enum stage_code {
    STAGE_OK = 0,
    STAGE_FAILED = 1,       /* port can't be opened, ... */
    STAGE_SILENT = 3,       /* no answer in time */
    STAGE_REFUSED = 4,      /* the controller said no, or stands where it should not */
    STAGE_GONE = 13,        /* unplugged; exit code 3 as well */
    STAGE_INTERRUPTED = 130 /* an unacknowledged signal (signals.h) ended the wait */
} stage_code;

typedef struct stage_facts {
    char ident[128];        /* what the controller calls itself */
    double steps_per_mm[2]; /* 0 = unknown */
    int has_travel;         /* lo..hi is where the stage can go once it is homed */
    double lo[2], hi[2];    /* mm */
    double max_feed[2];     /* mm/min, 0 = unknown */
    double acceleration[2]; /* mm/s2, 0 = unknown */
    int can_home;
    int reports_position; /* 0: the host counts */
} stage_facts;

typedef struct stage stage;

typedef struct stage_driver {
    const char *name, *about;
    int baud;
    stage_code (*connect)(stage *s, errmsg *e); /* identify, read settings; moves nothing */
    stage_code (*home)(stage *s, errmsg *e);
    /* Through n points to the last, then stand still for settle_s.  Confirmed by the controller. */
    stage_code (*go)(stage *s, const double (*path)[2], int n, double feed, double settle_s, errmsg *e);
    stage_code (*where)(stage *s, double xy[2], char state[32], errmsg *e);
    stage_code (*check)(stage *s, errmsg *e); /* anything amiss that came in meanwhile? */
    stage_code (*halt)(
        stage *s, errmsg *e); /* stop, keeping the position where that can be; works after an interrupt */
    void (*assume)(stage *s, const double xy[2]); /* for stages that don't report: it stands here */
    void (*release)(stage *s);                    /* free what connect made */
} stage_driver;

struct stage {
    const stage_driver *driver;
    port *port;
    stage_facts facts;
    int position_known; /* homed, or said so by the user */
    double home_timeout_s;
    void (*note)(const char *words); /* told of what the user may like to know; may be NULL */
    void *state;                     /* the driver's own */
    /* What the user states because the controller can't: steps_per_mm[2], 0 = not stated. */
    double stated_steps_per_mm[2];
};

extern const stage_driver stage_driver_grbl, stage_driver_c4;

const stage_driver *stage_driver_by_name(const char *name); /* NULL: none */

/* Lines for --help: "name  about". */
const stage_driver *stage_driver_at(int k); /* NULL past the end */

/* Open the port and connect.  On failure nothing stays open. */
stage_code stage_open(stage *s, const stage_driver *d, const char *path, errmsg *e);
void stage_close(stage *s);

/* A port_result as words and code. */
stage_code stage_port_error(errmsg *e, port_result r, const char *doing);

#endif
