/*
 * grbl.c - driver for GRBL 1.1 and grblHAL: finding out who is there and what its settings say.  Moves are in
 * grbl_move.c, homing and its switches in grbl_home.c.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "deadline.h"
#include "grbl_drive.h"

/* A boot loader's patience; after that a reset is sent and waited for.  Seconds. */
static const double banner_s = 3, reset_s = 3;

/* Machine space: homing ends at the switch, and GRBL counts from there: -travel..0, whichever end the switch
 * is at; built with the zero at home ('Z', or bit 3 of grblHAL's $22) it is 0..travel where $23 says so. With
 * hard limits ($21) the switch itself is out of bounds: touching it is an alarm.  The pull-off ($27) is the
 * distance at which it is known to be open; with the zero at home that is where the zero already lies. */
static void set_travel(stage *s)
{
    grbl *g = s->state;
    stage_facts *f = &s->facts;
    f->can_home = g->home_switch & 1;
    f->has_travel = f->can_home && g->travel[0] > 0 && g->travel[1] > 0;
    if (g->is_hal && (g->home_switch & 8)) g->origin_at_home = 1;
    f->margin_mm = g->hard_limits && !g->origin_at_home ? g->pull_off : 0;
    for (int a = 0; a < 2; a++) {
        int low_end = g->home_direction >> a & 1, positive = g->origin_at_home && low_end;
        f->lo[a] = positive ? 0 : -g->travel[a];
        f->hi[a] = positive ? g->travel[a] : 0;
        if (low_end) f->lo[a] += f->margin_mm;
        else f->hi[a] -= f->margin_mm;
    }
    if (g->is_hal && (g->keep_on & 3) == 3) f->motors_rest_ms = 255;
}

/* All settings, until two readings agree: a damaged line of them looks like another value, or isn't there. */
static stage_code read_settings(stage *s, errmsg *e)
{
    grbl *g = s->state;
    uint64_t before = 0;
    for (int tries = 0; tries < 5; tries++) {
        g->settings_sum = 1;
        stage_code r = grbl_command(s, "$$\n", answer_s, "reading the controller's settings", e);
        if (r != STAGE_OK) return r;
        if (g->settings_sum == before) return STAGE_OK;
        before = g->settings_sum;
    }
    err_set(e, "stage: the controller's settings read otherwise each time: a disturbed line");
    return STAGE_REFUSED;
}

/* Find out that someone is there.  Opening the port reboots many boards: their banner comes within 3 s.
 * Others answer a status query at once; whatever they still do is stopped.  Both end in a fresh banner. */
static stage_code wake(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double start = now_s(), ask = start;
    int reset_sent = 0, status_seen = 0;
    for (;;) {
        double now = now_s();
        if (now >= start + banner_s + reset_s) {
            err_set(e, "stage: no answer from a GRBL controller within %g s", banner_s + reset_s);
            return STAGE_SILENT;
        }
        stage_code r = STAGE_OK;
        if (!reset_sent && now >= start + banner_s) {
            r = grbl_realtime(s, GRBL_RESET, e);
            reset_sent = 1;
        } else if (now >= ask) {
            r = grbl_realtime(s, GRBL_STATUS_QUERY, e);
            ask = now + 0.25;
        }
        if (r == STAGE_OK)
            r = grbl_take(s, &m, WANT_BANNER | WANT_STATUS, ask, "waiting for the controller", e);
        if (r == STAGE_SILENT) continue;
        if (r != STAGE_OK) return r;
        if (m.kind == GRBL_STATUS) {
            status_seen = 1;
            int still = m.state == GRBL_IDLE || m.state == GRBL_ALARMED || m.state == GRBL_HELD ||
                        m.state == GRBL_CHECK || m.state == GRBL_SLEEP;
            s->position_known = m.state != GRBL_ALARMED && m.state != GRBL_SLEEP;
            if (s->look_only) {
                snprintf(s->facts.ident, sizeof s->facts.ident, "GRBL"); /* $I tells more */
                if (m.state == GRBL_IDLE || m.state == GRBL_ALARMED) return STAGE_OK;
                err_set(e, "stage: in state %s: not disturbed", grbl_state_name(m.state));
                return STAGE_REFUSED;
            }
            if (still) r = grbl_soft_reset(s, &m, e);
            else if (m.state == GRBL_DOOR) { /* it may still be slowing down */ int known = s->position_known;
                r = grbl_halt(s, e);
                s->position_known = s->position_known && known;
                if (r == STAGE_OK) r = grbl_soft_reset(s, &m, e);
            } else {
                if (s->note) s->note("stage: found it moving; stopping it first");
                if ((r = grbl_halt(s, e)) != STAGE_OK) return r;
                r = grbl_soft_reset(s, &m, e); /* once more for the banner's text */
            }
            if (r != STAGE_OK) return r;
        }
        if (m.kind == GRBL_BANNER && !reset_sent && !status_seen) s->restarted = 1;
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
    if (r == STAGE_OK) r = grbl_command(s, "$G\n", answer_s, "asking for the modes", e);
    if (r == STAGE_OK) r = grbl_command(s, "$I\n", answer_s, "asking what the controller is", e);
    if (r == STAGE_OK) r = read_settings(s, e);
    if (r == STAGE_OK) r = grbl_query(s, &m, xy, e);
    if (r == STAGE_OK && m.state == GRBL_DOOR) r = grbl_stuck(s, &m, "asking for the status", e);
    if (r != STAGE_OK) return r;
    if (!(s->facts.steps_per_mm[0] > 0 && s->facts.steps_per_mm[1] > 0)) {
        err_set(e, "stage: expected the settings $100 and $101 (steps/mm), found none");
        return STAGE_REFUSED;
    }
    s->facts.reports_position = 1;
    set_travel(s);
    s->locked = m.state == GRBL_ALARMED;
    if (s->locked) s->position_known = 0;
    else if (!s->facts.can_home) s->position_known = 1; /* the controller's zero is what the user made it */
    return STAGE_OK;
}

static stage_code grbl_where(stage *s, double xy[2], char state[32], errmsg *e)
{
    grbl_message m;
    stage_code r = grbl_query(s, &m, xy, e);
    if (r == STAGE_OK) snprintf(state, 32, "%s", grbl_state_name(m.state));
    return r;
}

static stage_code grbl_check(stage *s, errmsg *e)
{
    grbl_message m;
    stage_code r = grbl_take(s, &m, 0, now_s(), "exposing", e);
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

const stage_driver stage_driver_grbl = {.name = "grbl",
                                        .about = "GRBL 1.1 and grblHAL, 115200 baud",
                                        .baud = GRBL_BAUD,
                                        .connect = grbl_connect,
                                        .home = grbl_home,
                                        .go = grbl_go,
                                        .where = grbl_where,
                                        .check = grbl_check,
                                        .halt = grbl_halt,
                                        .assume = grbl_assume,
                                        .unlock = grbl_unlock,
                                        .find_switches = grbl_find_switches,
                                        .release = grbl_release};
