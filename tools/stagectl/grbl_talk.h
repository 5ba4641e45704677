/*
 * grbl_talk.h - the conversation with a GRBL controller, for grbl.c: one line, one answer, and all that comes
 * between.
 */
#ifndef GRBL_TALK_H
#define GRBL_TALK_H

#include <stdint.h>

#include "grbl_proto.h"
#include "linebuf.h"
#include "stage.h"

enum { WANT_ANSWER = 1, WANT_STATUS = 2, WANT_BANNER = 4, WANT_MODES = 8 };

/* seconds */
static const double answer_s = 5, poll_s = 0.2, ask_s = 1;
enum { DEAD_ASKS = 3 }; /* status queries of ask_s each without a word: nobody is there */

typedef struct grbl {
    linebuf line;
    unsigned char in[256];
    size_t at, n;
    char text[LINE_MAX_BYTES + 1]; /* the line that the last message points into */
    char asked[LINE_MAX_BYTES];    /* last command, for messages */
    int inches, is_hal, home_switch, home_direction, origin_at_home, soft_limits, hard_limits, keep_on;
    double seek, locate, debounce_ms, pull_off, travel[3],
        rate[3];                /* $25 $24 $26 $27 $13x $11x; 0 = unknown */
    int need_reset, resettable; /* in a critical alarm; from when on a reset is not thrown away */
    double alarm_time;
    int alarm;             /* number of the last one since the last reset; 0 = none */
    uint64_t settings_sum; /* FNV-1a of the lines of settings since it was set */
    int homing;            /* deaf to hold and query: only a reset stops it */
    int tells_modes;       /* $G is answered by [GC:...]: the way to know that all lines before it are done */
    int lost;              /* answers that never came, though it was there */
    double offset[GRBL_AXES]; /* WCO, mm */
    int has_offset;
    double last[2]; /* last reported or commanded machine position, mm */
    int noise;
} grbl;

/* Read until something wanted comes.  Alarms and unasked-for banners end every wait. */
stage_code grbl_take(stage *s, grbl_message *m, int want, double deadline, const char *doing, errmsg *e);
stage_code grbl_send(stage *s, const char *line, const char *doing, errmsg *e); /* and note it for messages */
stage_code grbl_realtime(stage *s, char byte, errmsg *e);
/* One line, its one answer.  If that does not come, a status query tells why: nobody there, a state in which
 * no line is worked off, or an answer lost on the line; then it goes on once the line is surely worked off.
 */
stage_code grbl_command(stage *s, const char *line, double timeout_s, const char *doing, errmsg *e);
/* Ask for a status, for three seconds at four a second, and take the first with a position. */
stage_code grbl_query(stage *s, grbl_message *m, double xy[2], errmsg *e);
/* Wait until all lines sent before are worked off, whatever became of their answers. */
stage_code grbl_sync(stage *s, const char *doing, errmsg *e);
/* A state in which nothing goes on, in words. */
stage_code grbl_stuck(stage *s, const grbl_message *m, const char *doing, errmsg *e);
/* Soft reset: clears every pending answer; a late ok may come before the banner and is passed over. */
stage_code grbl_soft_reset(stage *s, grbl_message *m, errmsg *e);
/* Stop what moves: hold, wait until it stands, reset.  So there is no alarm and the position is kept. */
stage_code grbl_halt(stage *s, errmsg *e);
/* Count the asking for a status: 0, or STAGE_SILENT when it has been in vain too often. */
typedef struct grbl_asking {
    int asked; /* since it was last heard */
    double since;
} grbl_asking;
stage_code grbl_ask(stage *s, grbl_asking *a, const char *doing, errmsg *e);
/* Position of a status in machine mm.  0 if it can't be told yet (work position, offset not seen). */
int grbl_machine_position(stage *s, double xy[2], const grbl_message *m);

#endif
