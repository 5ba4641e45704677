/*
 * vgrbl.h - a GRBL 1.1 controller with a stage attached, in simulated time (pure: bytes in, bytes out).
 *
 * What the controller believes (machine position) and where the stage truly stands are kept apart: they agree
 * after homing, and part again when the position is lost.
 */
#ifndef VGRBL_H
#define VGRBL_H

#include <stddef.h>

#include "stagectl/linebuf.h"
#include "vmotion.h"

enum { VGRBL_PLANNER = 15, VGRBL_RX = 127, VGRBL_OUT = 8192 };

typedef enum vgrbl_state {
    V_IDLE,
    V_RUN,
    V_HOLD,
    V_HELD,
    V_HOME,
    V_ALARM,
    V_DOOR,
    V_SLEEP,
    V_CHECK
} vgrbl_state;

typedef enum vgrbl_fault {
    FAULT_NONE,
    FAULT_ALARM1,  /* limit switch in the middle of the move */
    FAULT_ALARM3,  /* reset in the middle of the move */
    FAULT_ERROR9,  /* locked when the move comes */
    FAULT_REBOOT,  /* power fails in the middle of the move */
    FAULT_SILENCE, /* nothing is said any more */
    FAULT_UNPLUG,  /* the host's business: see vgrbl_unplugged */
    FAULT_SLIP,    /* the motor loses 2 mm and the controller does not notice... until homing */
    FAULT_HOLD,    /* somebody presses feed hold in the middle of the move */
    FAULT_DOOR,    /* ... opens the safety door (it is shut again by the next reset) */
    FAULT_SLEEP,   /* sent to sleep when the move comes */
    FAULT_CHECK,   /* check mode when the move comes */
    FAULT_GARBLE,  /* the ok of the move is damaged */
    FAULT_STRAY    /* the move is answered twice */
} vgrbl_fault;

typedef struct vgrbl_settings {
    double steps_per_mm[2], max_rate[2] /* mm/min */, acceleration[2] /* mm/s2 */, travel[2] /* mm */;
    int idle_delay /* $1, ms */, z_first /* $H looks for a Z that isn't there */,
        single_axis /* takes $HX, $HY */;
    int inches, work_positions, homing, soft_limits, hard_limits, home_direction, hal;
    double home_rate;    /* mm/min */
    double offset[2];    /* G54, mm */
    const char *startup; /* $N0, or NULL */
    int skip_status;     /* answer one '?' in so many; 0, 1 = all */
    int late_ok;         /* a reset answers the pending command first */
    vgrbl_fault fault;
    long fault_at; /* number of the move, from 1 */
} vgrbl_settings;

typedef struct vgrbl {
    vgrbl_settings set;
    double now; /* s, simulated */
    vgrbl_state state;
    int critical;                   /* deaf to lines until reset */
    double deaf_until;              /* > 0: throws resets away until then, and says so when it is over */
    double belief[2], shift[2];     /* machine position; truth - belief */
    vmove move;                     /* the one under way */
    double queue[VGRBL_PLANNER][3]; /* targets and feed (mm/s) behind it */
    int moving, queued;
    double ask_feed; /* modal: mm/min, 0 = none */
    int inch_mode, relative, motion;
    double dwell_end; /* > 0: a dwell runs */
    double dwell_s;
    int waiting; /* 0 none, 'd' dwell wants an empty planner, 'p' move wants room, 'h' homing */
    double held_target[3];
    double home_end, home_from[2];
    int home_axes; /* bits */
    char rx[VGRBL_RX];
    size_t rx_n;
    char out[VGRBL_OUT];
    size_t out_n;
    long moves, queries;
    double fault_time; /* > 0: when the fault strikes */
    int silent, unplugged, door, garble;
} vgrbl;

void vgrbl_init(vgrbl *g, const vgrbl_settings *s, const double true_position[2]);
void vgrbl_power_up(vgrbl *g); /* says the banner */
void vgrbl_byte(vgrbl *g, unsigned char byte);
void vgrbl_advance(vgrbl *g, double now); /* to this time, everything due on the way */
double vgrbl_next(const vgrbl *g);        /* time of the next thing to happen; INFINITY = nothing */
void vgrbl_truth(const vgrbl *g, double xy[2], double *speed);

#endif
