/*
 * grbl_proto.h - what GRBL 1.1 and grblHAL say and are told: bytes <-> messages, no I/O.
 *
 * Lines that answer a command are ok and error:N and nothing else; all others may come at any time.
 */
#ifndef GRBL_PROTO_H
#define GRBL_PROTO_H

#include <stddef.h>

enum { GRBL_AXES = 6, GRBL_BAUD = 115200, GRBL_LINE_MAX = 79 };

/* Real-time bytes: acted upon at once, outside the line protocol. */
#define GRBL_STATUS_QUERY '?'
#define GRBL_HOLD         '!'
#define GRBL_RESET        0x18

typedef enum grbl_kind {
    GRBL_OK,
    GRBL_ERROR,      /* number */
    GRBL_ALARM,      /* number */
    GRBL_STATUS,     /* state ... */
    GRBL_BANNER,     /* text: name and version; supported says whether it is 1.1 or later */
    GRBL_SETTING,    /* $number=value */
    GRBL_FEEDBACK,   /* [...] */
    GRBL_MODES,      /* [GC:...], what $G says: all lines before it have been worked off */
    GRBL_RESETTABLE, /* [MSG:Reset to continue]: from now on a critical alarm takes a reset */
    GRBL_ECHO,       /* >G21:ok, a start-up line that was run */
    GRBL_NOISE       /* none of these */
} grbl_kind;

typedef enum grbl_state {
    GRBL_IDLE,
    GRBL_RUN,
    GRBL_HOLDING,
    GRBL_HELD,
    GRBL_JOG,
    GRBL_HOMING,
    GRBL_ALARMED,
    GRBL_CHECK,
    GRBL_DOOR,
    GRBL_SLEEP,
    GRBL_TOOL,
    GRBL_OTHER
} grbl_state;

typedef struct grbl_message {
    grbl_kind kind;
    int number;       /* error, alarm, setting */
    double value;     /* setting */
    int supported;    /* banner */
    grbl_state state; /* status; GRBL_HELD = hold complete */
    int sub;          /* status: Door:2 gives 2; -1 = none */
    int limits;       /* status: bits of the limit switches that are pressed (Pn:XY) */
    int axes;         /* status: axes in pos */
    int is_work;      /* status: pos is the work position, not the machine's */
    double pos[GRBL_AXES], offset[GRBL_AXES]; /* as reported: mm, or inches with $13=1 */
    int has_offset;                           /* status carried WCO: machine = work + offset */
    const char *text;                         /* points into the line */
} grbl_message;

/* Understand one line (no line end). */
void grbl_parse(grbl_message *m, const char *line);

/* The published words for a number; "unknown ..." where there are none. */
const char *grbl_error_words(int number);
const char *grbl_alarm_words(int number);
const char *grbl_state_name(grbl_state s);

/* What a state in which no line is worked off means and what helps; NULL: an ordinary one. */
const char *grbl_state_words(grbl_state s);

/* Command lines, with '\n'; size_t room >= GRBL_LINE_MAX + 2.  Return the length. */
size_t grbl_format_move(char *out, size_t room, const double xy_mm[2], double feed_mm_min);
size_t grbl_format_dwell(char *out, size_t room, double seconds);

#endif
