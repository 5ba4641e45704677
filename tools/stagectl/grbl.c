/*
 * grbl.c - driver for GRBL 1.1 and grblHAL: a dwell as the barrier, the position read back.
 *
 * ok means parsed and queued, not moved.  The ok of a dwell (G4) comes when the planner is empty and the
 * dwell is over; only a status of Idle at the target is taken as standing still.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "deadline.h"
#include "grbl_talk.h"

/* A boot loader's patience; after that a reset is sent and waited for.  Seconds. */
static const double banner_s = 3, reset_s = 3;

/* Machine space: homing ends at the switch, and GRBL counts from there: -travel..0, whichever end the switch
 * is at; built with the zero at home ('Z', or bit 3 of grblHAL's $22) it is 0..travel where $23 says so. */
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

/* Find out that someone is there.  Opening the port reboots many boards: their banner comes within 3 s.
 * Others answer a status query at once; whatever they still do is stopped.  Both end in a fresh banner. */
static stage_code wake(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double start = now_s(), ask = start;
    int reset_sent = 0;
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
            s->position_known = m.state != GRBL_ALARMED;
            if (m.state == GRBL_IDLE || m.state == GRBL_ALARMED || m.state == GRBL_HELD)
                r = grbl_soft_reset(s, &m, e);
            else {
                if (s->note) s->note("stage: found it moving; stopping it first");
                if ((r = grbl_halt(s, e)) != STAGE_OK) return r;
                r = grbl_soft_reset(s, &m, e); /* once more for the banner's text */
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
    if (r == STAGE_OK) r = grbl_command(s, "$I\n", answer_s, "asking what the controller is", e);
    if (r == STAGE_OK) r = grbl_command(s, "$$\n", answer_s, "reading the controller's settings", e);
    if (r == STAGE_OK) r = grbl_query(s, &m, xy, e);
    if (r != STAGE_OK) return r;
    if (!(s->facts.steps_per_mm[0] > 0 && s->facts.steps_per_mm[1] > 0)) {
        err_set(e, "stage: expected the settings $100 and $101 (steps/mm), found none");
        return STAGE_REFUSED;
    }
    s->facts.reports_position = 1;
    set_travel(s);
    if (m.state == GRBL_ALARMED)
        s->position_known = 0;
    else if (!s->facts.can_home)
        s->position_known = 1; /* the controller's zero is what the user made it */
    return STAGE_OK;
}

static stage_code grbl_home(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    stage_code r = g->need_reset ? grbl_soft_reset(s, &m, e) : STAGE_OK;
    if (r == STAGE_OK && !s->facts.can_home) {
        err_set(e, "stage: homing is switched off in the controller ($22=0)");
        return STAGE_REFUSED;
    }
    s->position_known = 0;
    if (r == STAGE_OK) r = grbl_command(s, "$H\n", s->home_timeout_s, "homing", e);
    /* Start-up lines run again after homing and may have changed the modes. */
    if (r == STAGE_OK) r = grbl_command(s, "G21G90G94G17G54\n", answer_s, "setting the modes", e);
    double xy[2];
    if (r == STAGE_OK) r = grbl_query(s, &m, xy, e);
    if (r != STAGE_OK) return r;
    s->position_known = 1;
    return STAGE_OK;
}

/* The ok of the dwell; the deadline moves on while the stage does. */
static stage_code barrier(stage *s, double settle_s, double expected_s, errmsg *e)
{
    grbl_message m;
    char line[GRBL_LINE_MAX + 2];
    double now = now_s(), deadline = now + expected_s * 2 + answer_s + settle_s, ask = now + poll_s, xy[2],
           before[2] = {NAN, NAN};
    grbl_format_dwell(line, sizeof line, settle_s);
    stage_code r = grbl_send(s, line, "moving", e);
    while (r == STAGE_OK) {
        r = grbl_take(s, &m, WANT_ANSWER | WANT_STATUS, fmin(ask, deadline), "moving", e);
        now = now_s();
        if (r == STAGE_OK && m.kind == GRBL_OK) return STAGE_OK;
        if (r == STAGE_OK && m.state == GRBL_ALARMED) {
            err_set(e, "stage: in alarm while moving");
            r = STAGE_REFUSED;
        } else if (r == STAGE_OK && grbl_machine_position(s, xy, &m)) {
            if (xy[0] != before[0] || xy[1] != before[1])
                deadline = fmax(deadline, now + answer_s + settle_s);
            memcpy(before, xy, sizeof before);
        } else if (r == STAGE_SILENT && now < deadline) {
            ask = now + poll_s;
            r = grbl_realtime(s, GRBL_STATUS_QUERY, e);
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
        stage_code r = grbl_query(s, &m, xy, e);
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
        stage_code r = grbl_command(s, line, answer_s, "sending a move", e);
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
                                        .release = grbl_release};
