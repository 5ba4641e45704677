/*
 * stage.h - a stage of two axes behind a table of functions.
 *
 * Positions are machine coordinates in mm, x then y; feeds mm/min; times s.  Every call returns
 * STAGE_OK or the exit code that fits, with words in the errmsg.
 */
#ifndef STAGE_H
#define STAGE_H

#include "base/errmsg.h"
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
    int motors_rest_ms;   /* after a move the motors lose their current so soon; 255 = never, -1 = unknown */
    double margin_mm;     /* the travel ends so far from the limit switch, because touching it is an alarm */
} stage_facts;

typedef struct stage stage;

typedef struct stage_driver {
    const char *name, *about;
    int baud;                                   /* unless the user says otherwise */
    stage_code (*connect)(stage *s, errmsg *e); /* identify, read settings; moves nothing */
    stage_code (*home)(stage *s, errmsg *e);
    /* Through n points to the last, then stand still for settle_s.  Confirmed by the controller. */
    stage_code (*go)(stage *s, const double (*path)[2], int n, double feed, double settle_s, errmsg *e);
    stage_code (*where)(stage *s, double xy[2], char state[32], errmsg *e);
    stage_code (*check)(stage *s, errmsg *e); /* anything amiss that came in meanwhile? */
    stage_code (*halt)(
        stage *s, errmsg *e); /* stop, keeping the position where that can be; works after an interrupt */
    void (*assume)(stage *s, const double xy[2]); /* for stages that don't report: it stands here */
    stage_code (*unlock)(stage *s, errmsg *e);    /* out of an alarm without homing; NULL: there is none */
    /* Where each axis meets its homing switch, by the position that the controller believes in: it creeps
     * there from the homed side.  found[a] = 0: not within reach, seen is the last place without it.  Home
     * afterwards.  NULL: the controller doesn't show its switches. */
    stage_code (*find_switches)(stage *s, double seen[2], int found[2], errmsg *e);
    void (*release)(stage *s); /* free what connect made */
} stage_driver;

struct stage {
    const stage_driver *driver;
    port *port;
    stage_facts facts;
    int position_known; /* homed, or said so by the user */
    int under_way;      /* told to move and not yet seen to stand: halt it before leaving */
    int locked;         /* in alarm: moves are refused until it is homed or unlocked */
    int restarted;      /* it started up when the port was opened: where it stands is unknown to it */
    /* The user's wishes, set before stage_open: */
    double home_timeout_s;           /* 0 = what the controller's settings say that it can take */
    const char *homing;              /* commands that home it; NULL or "" = $H */
    int baud;                        /* 0 = the driver's */
    int dtr_off;                     /* drop DTR and RTS once the port is open */
    int look_only;                   /* reset nothing: only read what it is (it must stand) */
    void (*note)(const char *words); /* told of what the user may like to know; may be NULL */
    void *state;                     /* the driver's own */
    /* What the user states because the controller can't: steps_per_mm[2], 0 = not stated. */
    double stated_steps_per_mm[2];
};

extern const stage_driver stage_driver_grbl, stage_driver_c4;

const stage_driver *stage_driver_by_name(const char *name); /* NULL: none */

/* Lines for --help: "name  about". */
const stage_driver *stage_driver_at(int k); /* NULL past the end */

/* Homing commands, as in homing = $HX $HY: each $H and at most one axis. */
int stage_homing_check(const char *words, errmsg *e);

/* Open the port and connect.  On failure nothing stays open. */
stage_code stage_open(stage *s, const stage_driver *d, const char *path, errmsg *e);
void stage_close(stage *s);

/* What to say of motors that lose their current while the camera exposes; 0: nothing. */
int motors_words(char *out, size_t room, const stage_facts *f);

/* A port_result as words and code. */
stage_code stage_port_error(errmsg *e, port_result r, const char *doing);

#endif
