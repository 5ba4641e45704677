/*
 * grbl.c - driver for GRBL 1.1 and grblHAL: one line, one answer; a dwell as the barrier; the position read back.
 *
 * ok means parsed and queued, not moved.  The ok of a dwell (G4) comes when the planner is empty and the
 * dwell is over; only a status of Idle at the target is taken as standing still.  Nothing else counts: an ok
 * may be late, statuses may be skipped, and messages, start-up lines and a reset's left-over ok may
 * come at any time.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "deadline.h"
#include "grbl_proto.h"
#include "linebuf.h"
#include "signals.h"
#include "stage.h"

enum { WANT_ANSWER = 1, WANT_STATUS = 2, WANT_BANNER = 4 };

/* seconds */
static const double answer_s = 5, query_s = 0.25, banner_s = 3, poll_s = 0.2, hold_s = 10;

typedef struct grbl {
    linebuf line;
    unsigned char in[256];
    size_t at, n;
    char text[LINE_MAX_BYTES + 1]; /* the line that the last message points into */
    char asked[LINE_MAX_BYTES];    /* last command, for messages */
    int inches, is_hal, home_switch, home_direction, origin_at_home, need_reset;
    double offset[GRBL_AXES];      /* WCO, mm */
    int has_offset;
    double last[2];                /* last reported or commanded machine position, mm */
    int noise;
} grbl;

static stage_code next_line(stage *s, grbl_message *m, double deadline, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    for (;;) {
        while (g->at < g->n)
            if (linebuf_push(&g->line, g->in[g->at++])) {
                memcpy(g->text, g->line.text, sizeof g->text);
                grbl_parse(m, g->text);
                return STAGE_OK;
            }
        g->at = g->n = 0;
        port_result r = port_receive(s->port, g->in, sizeof g->in, &g->n, deadline);
        if (r != PORT_OK) {
            g->n = 0;
            return stage_port_error(e, r, doing);
        }
    }
}

static void keep_setting(stage *s, const grbl_message *m)
{
    grbl *g = s->state;
    stage_facts *f = &s->facts;
    int whole = (int)fmin(fmax(m->value, -1e6), 1e6);
    switch (m->number) {
    case 13: g->inches = whole != 0; break;
    case 22: g->home_switch = whole; break;
    case 23: g->home_direction = whole; break;
    case 100: case 101: f->steps_per_mm[m->number - 100] = m->value; break;
    case 110: case 111: f->max_feed[m->number - 110] = m->value; break;
    case 120: case 121: f->acceleration[m->number - 120] = m->value; break;
    case 130: case 131: f->hi[m->number - 130] = fabs(m->value); break; /* sorted out in set_travel */
    default: break;
    }
}

/* Position of a status in machine mm.  0 if it can't be told yet (work position, offset not seen). */
static int machine_position(stage *s, double xy[2], const grbl_message *m)
{
    grbl *g = s->state;
    double unit = g->inches ? 25.4 : 1;
    if (m->has_offset) {
        for (int a = 0; a < 2; a++) g->offset[a] = m->offset[a] * unit;
        g->has_offset = 1;
    }
    if (m->is_work && !g->has_offset) return 0;
    for (int a = 0; a < 2; a++) xy[a] = m->pos[a] * unit + (m->is_work ? g->offset[a] : 0);
    return 1;
}

/* Read until something wanted comes.  Alarms and unasked-for banners end every wait. */
static stage_code take(stage *s, grbl_message *m, int want, double deadline, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    for (;;) {
        stage_code r = next_line(s, m, deadline, doing, e);
        if (r != STAGE_OK) return r;
        switch (m->kind) {
        case GRBL_OK:
            if (want & WANT_ANSWER) return STAGE_OK;
            break;
        case GRBL_ERROR:
            if (!(want & WANT_ANSWER)) break;
            err_set(e, "stage: error:%d (%s) to '%s'", m->number, grbl_error_words(m->number), g->asked);
            return STAGE_REFUSED;
        case GRBL_ALARM:
            if (want & WANT_BANNER) break; /* a reset may raise one on its way */
            if (m->number != 2) s->position_known = 0;
            g->need_reset = 1;
            err_set(e, "stage: ALARM:%d (%s) after '%s'", m->number, grbl_alarm_words(m->number), g->asked);
            return STAGE_REFUSED;
        case GRBL_STATUS:
            if (want & WANT_STATUS) return STAGE_OK;
            break;
        case GRBL_BANNER:
            if (want & WANT_BANNER) return STAGE_OK;
            s->position_known = 0;
            err_set(e, "stage: the controller restarted while %s: its position is lost, home it", doing);
            return STAGE_REFUSED;
        case GRBL_SETTING: keep_setting(s, m); break;
        case GRBL_FEEDBACK:
            if (!strncmp(m->text, "[VER:", 5)) {
                size_t n = strlen(s->facts.ident);
                snprintf(s->facts.ident + n, sizeof s->facts.ident - n, " %.60s", m->text);
            } else if (!strncmp(m->text, "[OPT:", 5)) {
                /* build options end at the first comma; Z: the machine's zero is where it homes */
                g->origin_at_home = memchr(m->text + 5, 'Z', strcspn(m->text + 5, ",]")) != NULL;
            }
            break;
        case GRBL_NOISE:
            if (!g->noise++ && s->note) s->note("stage: noise on the line (reported once)");
            break;
        case GRBL_ECHO: break;
        }
    }
}

static stage_code send(stage *s, const void *bytes, size_t n, int ignore_interrupt, const char *doing, errmsg *e)
{
    return stage_port_error(e, port_send(s->port, bytes, n, now_s() + answer_s, ignore_interrupt), doing);
}

static stage_code realtime(stage *s, char byte, errmsg *e)
{
    return send(s, &byte, 1, 1, "sending a real-time command", e);
}

/* One line, its one answer. */
static stage_code command(stage *s, const char *line, double timeout_s, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    snprintf(g->asked, sizeof g->asked, "%.*s", (int)strcspn(line, "\n"), line);
    stage_code r = send(s, line, strlen(line), 0, doing, e);
    return r != STAGE_OK ? r : take(s, &m, WANT_ANSWER, now_s() + timeout_s, doing, e);
}

/* Ask for a status, for three seconds at four a second, and take the first with a position. */
static stage_code query(stage *s, grbl_message *m, double xy[2], errmsg *e)
{
    grbl *g = s->state;
    stage_code r = STAGE_SILENT;
    /* A work position is useless until the offset comes along, which GRBL adds to one in thirty. */
    for (int tries = 0, unanswered = 0; tries < 50 && unanswered < 12; tries++) {
        if ((r = realtime(s, GRBL_STATUS_QUERY, e)) != STAGE_OK) return r;
        r = take(s, m, WANT_STATUS, now_s() + query_s, "asking for the status", e);
        if (r == STAGE_OK && machine_position(s, xy, m)) {
            memcpy(g->last, xy, sizeof g->last);
            return STAGE_OK;
        }
        if (r == STAGE_OK) err_set(e, "stage: only work positions are reported, and no offset: set $10=1");
        if (r == STAGE_SILENT) unanswered++;
        if (r != STAGE_OK && r != STAGE_SILENT) return r;
        if (r == STAGE_OK) r = STAGE_REFUSED;
    }
    return r;
}

/* Soft reset: clears every pending answer; a late ok may come before the banner and is passed over. */
static stage_code soft_reset(stage *s, grbl_message *m, errmsg *e)
{
    grbl *g = s->state;
    stage_code r = realtime(s, GRBL_RESET, e);
    if (r == STAGE_OK) r = take(s, m, WANT_BANNER, now_s() + answer_s, "waiting for the banner after a reset", e);
    if (r == STAGE_OK) g->need_reset = 0;
    return r;
}

/* Stop what moves: hold, wait until it stands, reset.  So there is no alarm and the position is kept. */
static stage_code halt(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double until = now_s() + hold_s, xy[2], before[2] = {NAN, NAN};
    int silent = 0;
    stage_code r = g->need_reset ? STAGE_OK : realtime(s, GRBL_HOLD, e);
    while (r == STAGE_OK && !g->need_reset && now_s() < until && silent < 6) {
        if ((r = realtime(s, GRBL_STATUS_QUERY, e)) != STAGE_OK) break;
        r = take(s, &m, WANT_STATUS, now_s() + query_s, "waiting for the stage to hold", e);
        if (r == STAGE_INTERRUPTED) { /* asked twice: at once, whatever becomes of the position */
            signals_acknowledge();
            break;
        }
        if (r == STAGE_SILENT) {
            silent++; /* homing and critical alarms don't answer */
            r = STAGE_OK;
            continue;
        }
        if (r != STAGE_OK) break;
        if (m.state == GRBL_HELD || m.state == GRBL_IDLE || m.state == GRBL_ALARMED) break;
        /* builds that give no sub-state: standing still is what counts */
        if (machine_position(s, xy, &m) && xy[0] == before[0] && xy[1] == before[1] && m.state == GRBL_HOLDING) break;
        memcpy(before, xy, sizeof before);
        struct timespec pause = {.tv_nsec = 200000000}; /* statuses at 5 Hz at most */
        nanosleep(&pause, NULL);
    }
    if (r == STAGE_SILENT) return r;
    r = soft_reset(s, &m, e);
    if (r != STAGE_OK) return r;
    r = query(s, &m, g->last, e);
    if (r == STAGE_OK && m.state == GRBL_ALARMED) s->position_known = 0;
    return r;
}

/* Machine space: homing ends at the switch, and GRBL counts from there: -travel..0, whichever end the switch is at;
 * built with the zero at home ('Z', or bit 3 of grblHAL's $22) it is 0..travel where $23 says so. */
static void set_travel(stage *s)
{
    grbl *g = s->state;
    stage_facts *f = &s->facts;
    f->can_home = g->home_switch & 1;
    f->has_travel = f->can_home && f->hi[0] > 0 && f->hi[1] > 0;
    if (g->is_hal && (g->home_switch & 8)) g->origin_at_home = 1;
    for (int a = 0; a < 2; a++) {
        double travel = f->hi[a];
        int positive = g->origin_at_home && (g->home_direction >> a & 1);
        f->lo[a] = positive ? 0 : -travel;
        f->hi[a] = positive ? travel : 0;
    }
}

/* Find out that someone is there.  Opening the port reboots many boards: their banner comes within 3 s.  Others
 * answer a status query at once; whatever they still do is stopped.  Both end in a fresh banner. */
static stage_code wake(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double start = now_s(), ask = start;
    int reset_sent = 0;
    for (;;) {
        double now = now_s();
        if (now >= start + banner_s + answer_s) {
            err_set(e, "stage: no answer from a GRBL controller within %g s", banner_s + answer_s);
            return STAGE_SILENT;
        }
        stage_code r = STAGE_OK;
        if (!reset_sent && now >= start + banner_s) {
            r = realtime(s, GRBL_RESET, e);
            reset_sent = 1;
        } else if (now >= ask) {
            r = realtime(s, GRBL_STATUS_QUERY, e);
            ask = now + 0.25;
        }
        if (r == STAGE_OK) r = take(s, &m, WANT_BANNER | WANT_STATUS, ask, "waiting for the controller", e);
        if (r == STAGE_SILENT) continue;
        if (r != STAGE_OK) return r;
        if (m.kind == GRBL_STATUS) {
            s->position_known = m.state != GRBL_ALARMED;
            if (m.state == GRBL_IDLE || m.state == GRBL_ALARMED || m.state == GRBL_HELD) r = soft_reset(s, &m, e);
            else {
                if (s->note) s->note("stage: found it moving; stopping it first");
                if ((r = halt(s, e)) != STAGE_OK) return r;
                r = soft_reset(s, &m, e); /* once more for the banner's text */
            }
            if (r != STAGE_OK) return r;
        }
        if (!m.supported) {
            err_set(e, "stage: expected GRBL 1.1 or later, found '%.60s'", m.text);
            return STAGE_REFUSED;
        }
        g->is_hal = strncmp(m.text, "Grbl ", 5) != 0;
        snprintf(s->facts.ident, sizeof s->facts.ident, "%.*s", (int)strcspn(m.text, "["), m.text);
        size_t n = strlen(s->facts.ident);
        while (n > 0 && s->facts.ident[n - 1] == ' ') s->facts.ident[--n] = 0;
        return STAGE_OK;
    }
}

static stage_code grbl_connect(stage *s, errmsg *e)
{
    grbl_message m;
    double xy[2];
    s->state = calloc(1, sizeof(grbl));
    if (!s->state) {
        err_set(e, "out of memory");
        return STAGE_FAILED;
    }
    stage_code r = wake(s, e);
    if (r == STAGE_OK) r = command(s, "$I\n", answer_s, "asking what the controller is", e);
    if (r == STAGE_OK) r = command(s, "$$\n", answer_s, "reading the controller's settings", e);
    if (r == STAGE_OK) r = query(s, &m, xy, e);
    if (r != STAGE_OK) return r;
    if (!(s->facts.steps_per_mm[0] > 0 && s->facts.steps_per_mm[1] > 0)) {
        err_set(e, "stage: expected the settings $100 and $101 (steps/mm), found none");
        return STAGE_REFUSED;
    }
    s->facts.reports_position = 1;
    set_travel(s);
    if (m.state == GRBL_ALARMED) s->position_known = 0;
    else if (!s->facts.can_home) s->position_known = 1; /* the controller's zero is what the user made it */
    return STAGE_OK;
}

static stage_code grbl_home(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    stage_code r = g->need_reset ? soft_reset(s, &m, e) : STAGE_OK;
    if (r == STAGE_OK && !s->facts.can_home) {
        err_set(e, "stage: homing is switched off in the controller ($22=0)");
        return STAGE_REFUSED;
    }
    s->position_known = 0;
    if (r == STAGE_OK) r = command(s, "$H\n", s->home_timeout_s, "homing", e);
    /* Start-up lines run again after homing and may have changed the modes. */
    if (r == STAGE_OK) r = command(s, "G21G90G94G17G54\n", answer_s, "setting the modes", e);
    double xy[2];
    if (r == STAGE_OK) r = query(s, &m, xy, e);
    if (r != STAGE_OK) return r;
    s->position_known = 1;
    return STAGE_OK;
}

/* The ok of the dwell; the deadline moves on while the stage does. */
static stage_code barrier(stage *s, double settle_s, double expected_s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    char line[GRBL_LINE_MAX + 2];
    double now = now_s(), deadline = now + expected_s * 2 + answer_s + settle_s, ask = now + poll_s, xy[2], before[2] = {NAN, NAN};
    grbl_format_dwell(line, sizeof line, settle_s);
    snprintf(g->asked, sizeof g->asked, "%.*s", (int)strcspn(line, "\n"), line);
    stage_code r = send(s, line, strlen(line), 0, "moving", e);
    while (r == STAGE_OK) {
        r = take(s, &m, WANT_ANSWER | WANT_STATUS, fmin(ask, deadline), "moving", e);
        now = now_s();
        if (r == STAGE_OK && m.kind == GRBL_OK) return STAGE_OK;
        if (r == STAGE_OK && m.state == GRBL_ALARMED) {
            err_set(e, "stage: in alarm while moving");
            r = STAGE_REFUSED;
        } else if (r == STAGE_OK && machine_position(s, xy, &m)) {
            if (xy[0] != before[0] || xy[1] != before[1]) deadline = fmax(deadline, now + answer_s + settle_s);
            memcpy(before, xy, sizeof before);
        } else if (r == STAGE_SILENT && now < deadline) {
            ask = now + poll_s;
            r = realtime(s, GRBL_STATUS_QUERY, e);
        }
    }
    return r;
}

/* Idle and within half a step of the target, reported to so many decimals; given time for a late stop. */
static stage_code confirm(stage *s, const double target[2], errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double until = now_s() + answer_s, xy[2];
    double digit = g->inches ? 0.5e-4 * 25.4 : 0.5e-3;
    for (int still = 0; still < 3 && now_s() < until;) {
        stage_code r = query(s, &m, xy, e);
        if (r != STAGE_OK) return r;
        int there = 1;
        for (int a = 0; a < 2; a++)
            there = there && fabs(xy[a] - target[a]) <= 0.5 / s->facts.steps_per_mm[a] + 1.02 * digit;
        if (m.state == GRBL_IDLE && there) return STAGE_OK;
        if (m.state == GRBL_ALARMED) break;
        still = m.state == GRBL_IDLE ? still + 1 : 0;
        struct timespec pause = {.tv_nsec = 200000000};
        nanosleep(&pause, NULL);
    }
    err_set(e, "stage: expected it to stand at %.3f %.3f mm, found it %s at %.3f %.3f", target[0], target[1],
            grbl_state_name(m.state), g->last[0], g->last[1]);
    return STAGE_REFUSED;
}

static stage_code grbl_go(stage *s, const double (*path)[2], int n, double feed, double settle_s, errmsg *e)
{
    grbl *g = s->state;
    double seconds = 0, from[2] = {g->last[0], g->last[1]};
    for (int k = 0; k < n; k++) {
        char line[GRBL_LINE_MAX + 2];
        grbl_format_move(line, sizeof line, path[k], feed);
        stage_code r = command(s, line, answer_s, "sending a move", e);
        if (r != STAGE_OK) return r;
        for (int a = 0; a < 2; a++) {
            double limit = s->facts.max_feed[a] > 0 ? fmin(feed, s->facts.max_feed[a]) : feed;
            seconds += fabs(path[k][a] - from[a]) / limit * 60;
            from[a] = path[k][a];
        }
    }
    stage_code r = barrier(s, settle_s, seconds, e);
    return r == STAGE_OK ? confirm(s, path[n - 1], e) : r;
}

static stage_code grbl_where(stage *s, double xy[2], char state[32], errmsg *e)
{
    grbl_message m;
    stage_code r = query(s, &m, xy, e);
    if (r == STAGE_OK) snprintf(state, 32, "%s", grbl_state_name(m.state));
    return r;
}

static stage_code grbl_check(stage *s, errmsg *e)
{
    grbl_message m;
    stage_code r = take(s, &m, 0, now_s(), "exposing", e);
    return r == STAGE_SILENT ? STAGE_OK : r;
}

static void grbl_assume(stage *s, const double xy[2])
{
    (void)xy; /* it reports where it is; the user vouches for that */
    s->position_known = 1;
}

static void grbl_release(stage *s)
{
    free(s->state);
    s->state = NULL;
}

const stage_driver stage_driver_grbl = {
    .name = "grbl", .about = "GRBL 1.1 and grblHAL, 115200 baud", .baud = GRBL_BAUD,
    .connect = grbl_connect, .home = grbl_home, .go = grbl_go, .where = grbl_where,
    .check = grbl_check, .halt = halt, .assume = grbl_assume, .release = grbl_release};
