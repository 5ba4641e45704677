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

static const double query_s = 0.25, hold_s = 10, reset_s = 2; /* seconds */

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
    case 13:
        g->inches = whole != 0;
        break;
    case 22:
        g->home_switch = whole;
        break;
    case 23:
        g->home_direction = whole;
        break;
    case 100:
    case 101:
        f->steps_per_mm[m->number - 100] = m->value;
        break;
    case 110:
    case 111:
        f->max_feed[m->number - 110] = m->value;
        break;
    case 120:
    case 121:
        f->acceleration[m->number - 120] = m->value;
        break;
    case 130:
    case 131:
        f->hi[m->number - 130] = fabs(m->value);
        break; /* sorted out in set_travel */
    default:
        break;
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
        case GRBL_SETTING:
            keep_setting(s, m);
            break;
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
        case GRBL_ECHO:
            break;
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

stage_code grbl_command(stage *s, const char *line, double timeout_s, const char *doing, errmsg *e)
{
    grbl_message m;
    stage_code r = grbl_send(s, line, doing, e);
    return r != STAGE_OK ? r : grbl_take(s, &m, WANT_ANSWER, now_s() + timeout_s, doing, e);
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
    stage_code r = grbl_realtime(s, GRBL_RESET, e);
    if (r == STAGE_OK)
        r = grbl_take(s, m, WANT_BANNER, now_s() + reset_s, "waiting for the banner after a reset", e);
    if (r == STAGE_OK) g->need_reset = 0;
    return r;
}

stage_code grbl_halt(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double until = now_s() + hold_s, xy[2], before[2] = {NAN, NAN};
    int silent = 0;
    stage_code r = g->need_reset ? STAGE_OK : grbl_realtime(s, GRBL_HOLD, e);
    while (r == STAGE_OK && !g->need_reset && now_s() < until && silent < 6) {
        if ((r = grbl_realtime(s, GRBL_STATUS_QUERY, e)) != STAGE_OK) break;
        r = grbl_take(s, &m, WANT_STATUS, now_s() + query_s, "waiting for the stage to hold", e);
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
        if (grbl_machine_position(s, xy, &m) && xy[0] == before[0] && xy[1] == before[1] &&
            m.state == GRBL_HOLDING)
            break;
        memcpy(before, xy, sizeof before);
        struct timespec pause = {.tv_nsec = 200000000}; /* statuses at 5 Hz at most */
        nanosleep(&pause, NULL);
    }
    if (r == STAGE_SILENT) return r;
    r = grbl_soft_reset(s, &m, e);
    if (r != STAGE_OK) return r;
    r = grbl_query(s, &m, g->last, e);
    if (r == STAGE_OK && m.state == GRBL_ALARMED) s->position_known = 0;
    return r;
}
