/*
 * grbl_talk.c - see grbl_talk.h.
 *
 * Nothing but ok and error:N answers a line; an ok may be late, statuses may be skipped, and messages,
 * start-up lines and a reset's left-over ok may come at any time.
 */
#include "grbl_talk.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "deadline.h"
#include "signals.h"

/* Seconds.  GRBL throws away a reset that comes within half a second of a critical alarm. */
static const double query_s = 0.25, hold_s = 10, reset_s = 2, deaf_s = 0.6;

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
    for (const char *p = m->text; *p; p++)
        g->settings_sum = (g->settings_sum ^ (unsigned char)*p) * 0x100000001b3u;
    switch (m->number) {
    case 1: f->motors_rest_ms = whole; break;
    case 20: g->soft_limits = whole & 1; break;
    case 21: g->hard_limits = whole & 1; break;
    case 24: g->locate = m->value; break;
    case 25: g->seek = m->value; break;
    case 26: g->debounce_ms = m->value; break;
    case 27: g->pull_off = fabs(m->value); break;
    case 37: /* grblHAL: axes whose motors keep their current */ g->keep_on = whole; break;
    case 13: g->inches = whole != 0; break;
    case 22: g->home_switch = whole; break;
    case 23: g->home_direction = whole; break;
    case 100:
    case 101: f->steps_per_mm[m->number - 100] = m->value; break;
    case 110:
    case 111:
    case 112:
        g->rate[m->number - 110] = m->value;
        if (m->number < 112) f->max_feed[m->number - 110] = m->value;
        break;
    case 120:
    case 121: f->acceleration[m->number - 120] = m->value; break;
    case 130:
    case 131:
    case 132:
        g->travel[m->number - 130] = fabs(m->value); /* sorted out in set_travel */
        break;
    default: break;
    }
}

int grbl_machine_position(stage *s, double xy[2], const grbl_message *m)
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

stage_code grbl_take(stage *s, grbl_message *m, int want, double deadline, const char *doing, errmsg *e)
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
            g->alarm = m->number;
            g->alarm_time = now_s();
            if (m->number != 2) s->position_known = 0;
            if (want & WANT_BANNER) break; /* a reset may raise one on its way */
            g->need_reset = s->locked = 1;
            g->resettable = 0;
            err_set(e, "stage: ALARM:%d (%s) after '%s'", m->number, grbl_alarm_words(m->number), g->asked);
            return STAGE_REFUSED;
        case GRBL_STATUS:
            if (want & WANT_STATUS) return STAGE_OK;
            break;
        case GRBL_BANNER:
            if (want & WANT_BANNER) return STAGE_OK;
            s->position_known = s->under_way = g->homing = 0;
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
        case GRBL_MODES:
            g->tells_modes = 1;
            if (want & WANT_MODES) return STAGE_OK;
            break;
        case GRBL_RESETTABLE: g->resettable = 1; break;
        case GRBL_ECHO: break;
        }
    }
}

static stage_code send(stage *s, const void *bytes, size_t n, int ignore_interrupt, const char *doing,
                       errmsg *e)
{
    return stage_port_error(e, port_send(s->port, bytes, n, now_s() + answer_s, ignore_interrupt), doing);
}

stage_code grbl_send(stage *s, const char *line, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    snprintf(g->asked, sizeof g->asked, "%.*s", (int)strcspn(line, "\n"), line);
    return send(s, line, strlen(line), 0, doing, e);
}

stage_code grbl_realtime(stage *s, char byte, errmsg *e)
{
    return send(s, &byte, 1, 1, "sending a real-time command", e);
}

stage_code grbl_stuck(stage *s, const grbl_message *m, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    const char *words = grbl_state_words(m->state);
    if (!words) return STAGE_OK;
    if (m->state == GRBL_ALARMED) s->locked = 1;
    if (m->state == GRBL_SLEEP || (m->state == GRBL_ALARMED && g->alarm != 2)) s->position_known = 0;
    err_set(e, "stage: found it in state %s while %s: %s", grbl_state_name(m->state), doing, words);
    return STAGE_REFUSED;
}

stage_code grbl_ask(stage *s, grbl_asking *a, const char *doing, errmsg *e)
{
    double now = now_s();
    if (a->asked == 0) a->since = now;
    if (a->asked >= DEAD_ASKS && now - a->since >= DEAD_ASKS * ask_s) {
        err_set(e, "stage: no answer while %s, nor to %d status queries", doing, a->asked);
        return STAGE_SILENT;
    }
    a->asked++;
    return grbl_realtime(s, GRBL_STATUS_QUERY, e);
}

/* Wait for what is wanted; from late_s on a status query every now and then tells whether somebody is there
 * and whether lines are worked off.  STAGE_SILENT with *alive set: it is there, but what is wanted is not. */
static stage_code await(stage *s, grbl_message *m, int want, double late_s, double deadline, int *alive,
                        const char *doing, errmsg *e)
{
    double ask = now_s() + late_s;
    grbl *g = s->state;
    grbl_asking a = {0};
    *alive = 0;
    for (;;) {
        stage_code r = grbl_take(s, m, want | WANT_STATUS, fmin(ask, deadline), doing, e);
        if (r == STAGE_OK && m->kind != GRBL_STATUS) return r;
        if (r == STAGE_OK) {
            /* in alarm and in check mode lines are worked off, though only $ ones do something */
            int worked_off = m->state == GRBL_CHECK || (m->state == GRBL_ALARMED && g->asked[0] == '$');
            a.asked = 0;
            if (!worked_off && (r = grbl_stuck(s, m, doing, e)) != STAGE_OK) return r;
            if (++*alive == 2 && g->tells_modes) deadline = 0;
        } else if (r != STAGE_SILENT) return r;
        double now = now_s();
        if (now >= deadline && (*alive || a.asked == 0)) {
            err_set(e, "stage: no answer while %s", doing);
            return STAGE_SILENT;
        }
        if (now >= ask) {
            if ((r = grbl_ask(s, &a, doing, e)) != STAGE_OK) return r;
            ask = now + ask_s;
        }
        if (!*alive && a.asked) deadline = fmax(deadline, a.since + DEAD_ASKS * ask_s + 0.1);
    }
}

stage_code grbl_sync(stage *s, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    stage_code r = STAGE_OK;
    int alive = 1;
    if (!g->tells_modes) return STAGE_OK;
    for (int tries = 0; tries < 3 && alive; tries++) {
        if ((r = grbl_send(s, "$G\n", doing, e)) != STAGE_OK) return r;
        r = await(s, &m, WANT_MODES, ask_s, now_s() + answer_s, &alive, doing, e);
        if (r == STAGE_SILENT) continue;
        if (r == STAGE_OK) r = grbl_take(s, &m, WANT_ANSWER, now_s() + query_s, doing, e); /* its own ok */
        return r == STAGE_SILENT ? STAGE_OK : r;
    }
    return r;
}

stage_code grbl_command(stage *s, const char *line, double timeout_s, const char *doing, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    int alive;
    stage_code r = grbl_send(s, line, doing, e);
    if (r == STAGE_OK) r = await(s, &m, WANT_ANSWER, ask_s, now_s() + timeout_s, &alive, doing, e);
    if (r != STAGE_SILENT || !alive || !g->tells_modes) return r;
    if (!g->lost++ && s->note)
        s->note("stage: an answer was lost on the line; asked where it is and went on (reported once)");
    return grbl_sync(s, doing, e);
}

stage_code grbl_query(stage *s, grbl_message *m, double xy[2], errmsg *e)
{
    grbl *g = s->state;
    stage_code r = STAGE_SILENT;
    /* A work position is useless until the offset comes along, which GRBL adds to one in thirty. */
    for (int tries = 0, unanswered = 0; tries < 50 && unanswered < 12; tries++) {
        if ((r = grbl_realtime(s, GRBL_STATUS_QUERY, e)) != STAGE_OK) return r;
        r = grbl_take(s, m, WANT_STATUS, now_s() + query_s, "asking for the status", e);
        if (r == STAGE_OK && grbl_machine_position(s, xy, m)) {
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

stage_code grbl_soft_reset(stage *s, grbl_message *m, errmsg *e)
{
    grbl *g = s->state;
    stage_code r = STAGE_SILENT;
    /* the message that says so may be lost: time tells as well; a banner by itself will do */
    while (g->need_reset && !g->resettable && now_s() < g->alarm_time + deaf_s && r == STAGE_SILENT)
        r = grbl_take(s, m, WANT_BANNER, fmin(now_s() + 0.05, g->alarm_time + deaf_s),
                      "waiting for the end of an alarm", e);
    for (int tries = 0; tries < 2 && r == STAGE_SILENT; tries++) {
        r = grbl_realtime(s, GRBL_RESET, e);
        if (r == STAGE_OK)
            r = grbl_take(s, m, WANT_BANNER, now_s() + reset_s, "waiting for the banner after a reset", e);
    }
    if (r == STAGE_OK) g->need_reset = s->under_way = g->homing = 0;
    return r;
}

/* How long a stage may take to stand still after a hold: from full speed, v/a. */
static double hold_seconds(const stage *s)
{
    double most = hold_s;
    for (int a = 0; a < 2; a++)
        if (s->facts.max_feed[a] > 0 && s->facts.acceleration[a] > 0)
            most = fmax(most, 2 * s->facts.max_feed[a] / 60 / s->facts.acceleration[a] + 2);
    return fmin(most, 120);
}

/* After a hold: until it stands. */
static stage_code until_it_stands(stage *s, errmsg *e)
{
    grbl_message m;
    double until = now_s() + hold_seconds(s), xy[2], before[2] = {NAN, NAN};
    for (int silent = 0; now_s() < until && silent < 6;) {
        stage_code r = grbl_realtime(s, GRBL_STATUS_QUERY, e);
        if (r == STAGE_OK)
            r = grbl_take(s, &m, WANT_STATUS, now_s() + query_s, "waiting for the stage to hold", e);
        if (r == STAGE_INTERRUPTED) { /* asked twice: at once, whatever becomes of the position */
            signals_acknowledge();
            return STAGE_OK;
        }
        if (r == STAGE_SILENT) {
            silent++; /* critical alarms don't answer */
            continue;
        }
        if (r != STAGE_OK) return r;
        int at = grbl_machine_position(s, xy, &m), same = at && xy[0] == before[0] && xy[1] == before[1];
        if (at) memcpy(before, xy, sizeof before);
        if (m.state == GRBL_HELD || m.state == GRBL_IDLE || m.state == GRBL_ALARMED ||
            m.state == GRBL_CHECK || m.state == GRBL_SLEEP)
            return STAGE_OK;
        if (m.state == GRBL_RUN || m.state == GRBL_JOG) { /* lost on the line */
            r = grbl_realtime(s, GRBL_HOLD, e);
            if (r != STAGE_OK) return r;
        }
        /* builds that give no sub-state, and doors: standing still is what counts */
        if (same && (m.state == GRBL_HOLDING || m.state == GRBL_DOOR)) return STAGE_OK;
        struct timespec pause = {.tv_nsec = 200000000}; /* statuses at 5 Hz at most */
        nanosleep(&pause, NULL);
    }
    return STAGE_OK;
}

stage_code grbl_halt(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    stage_code r = STAGE_OK;
    if (!g->need_reset && !g->homing) { /* homing heeds nothing but a reset, and an alarm has stopped it */
        r = grbl_realtime(s, GRBL_HOLD, e);
        if (r == STAGE_OK) r = until_it_stands(s, e);
    }
    if (r != STAGE_OK && r != STAGE_REFUSED)
        return r; /* refused: an alarm has come; it is reset all the same */
    r = grbl_soft_reset(s, &m, e);
    if (r == STAGE_INTERRUPTED) {
        signals_acknowledge();
        r = grbl_soft_reset(s, &m, e);
    }
    if (r != STAGE_OK) return r;
    r = grbl_query(s, &m, g->last, e);
    if (r == STAGE_OK) s->locked = m.state == GRBL_ALARMED;
    if (r == STAGE_OK && s->locked && g->alarm != 2) s->position_known = 0;
    return r;
}
