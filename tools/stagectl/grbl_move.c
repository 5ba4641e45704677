/*
 * grbl_move.c - moves of the GRBL driver: a dwell as the barrier, the position read back.
 *
 * ok means parsed and queued, not moved.  The ok of a dwell (G4) comes when the planner is empty and the
 * dwell is over; but an ok has no name, and one too many on the line would pass for it.  So the modes are
 * asked for behind the dwell ($G): their answer has a name and comes after everything before it.  Only a
 * status of Idle at the target is taken as standing still.  Targets are absolute, so a lost answer costs
 * nothing: when the stage stands elsewhere after one, the path is sent again.
 */
#include <math.h>
#include <string.h>
#include <time.h>

#include "deadline.h"
#include "grbl_drive.h"

static int reached(const stage *s, const double xy[2], const double target[2])
{
    const grbl *g = s->state;
    double digit = g->inches ? 0.5e-4 * 25.4 : 0.5e-3;
    for (int a = 0; a < 2; a++)
        if (fabs(xy[a] - target[a]) > 0.5 / s->facts.steps_per_mm[a] + 1.02 * digit) return 0;
    return 1;
}

/* The ok of the dwell; the deadline moves on while the stage does.  Standing at the target for longer than
 * the dwell without that ok: it was lost. */
static stage_code barrier(stage *s, const double target[2], double settle_s, double expected_s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    grbl_asking asking = {0};
    char line[GRBL_LINE_MAX + 2];
    double now = now_s(), deadline = now + expected_s * 2 + answer_s + settle_s, ask = now + poll_s, xy[2],
           before[2] = {NAN, NAN}, there_since = INFINITY;
    grbl_format_dwell(line, sizeof line, settle_s);
    stage_code r = grbl_send(s, line, "moving", e);
    while (r == STAGE_OK) {
        r = grbl_take(s, &m, WANT_ANSWER | WANT_STATUS, fmin(ask, deadline), "moving", e);
        now = now_s();
        if (r == STAGE_OK && m.kind == GRBL_OK) return STAGE_OK;
        if (r == STAGE_OK) {
            asking.asked = 0;
            r = grbl_stuck(s, &m, "moving", e);
            if (r != STAGE_OK || !grbl_machine_position(s, xy, &m)) continue;
            if (xy[0] != before[0] || xy[1] != before[1])
                deadline = fmax(deadline, now + answer_s + settle_s);
            memcpy(before, xy, sizeof before);
            there_since = m.state == GRBL_IDLE && reached(s, xy, target) ? fmin(there_since, now) : INFINITY;
            if (g->tells_modes && now >= there_since + settle_s + ask_s) {
                g->lost++;
                return STAGE_OK;
            }
        } else if (r == STAGE_SILENT && now < deadline) {
            ask = now + poll_s;
            r = grbl_ask(s, &asking, "moving", e);
        } else if (r == STAGE_SILENT && !isnan(before[0]) && asking.asked < DEAD_ASKS) {
            err_set(e, "stage: expected it to reach %.3f %.3f mm, found it %s at %.3f %.3f and not going on",
                    target[0], target[1], grbl_state_name(m.state), before[0], before[1]);
            r = STAGE_REFUSED;
        }
    }
    return r;
}

/* Idle and within half a step of the target, reported to so many decimals; given time for a late stop.
 * *late: it was still on its way, so its rest is yet to come. */
static stage_code confirm(stage *s, const double target[2], int *late, int *elsewhere, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double until = now_s() + answer_s, xy[2], before[2] = {NAN, NAN};
    *late = *elsewhere = 0;
    for (int still = 0; still < 3 && now_s() < until;) {
        stage_code r = grbl_query(s, &m, xy, e);
        if (r == STAGE_OK) r = grbl_stuck(s, &m, "moving", e);
        if (r != STAGE_OK) return r;
        if (m.state == GRBL_IDLE && reached(s, xy, target)) return STAGE_OK;
        *late = 1;
        still = m.state == GRBL_IDLE ? still + 1 : 0;
        if (xy[0] != before[0] || xy[1] != before[1]) until = now_s() + answer_s;
        memcpy(before, xy, sizeof before);
        struct timespec pause = {.tv_nsec = 200000000};
        nanosleep(&pause, NULL);
    }
    *elsewhere = m.state == GRBL_IDLE;
    err_set(e, "stage: expected it to stand at %.3f %.3f mm, found it %s at %.3f %.3f", target[0], target[1],
            grbl_state_name(m.state), g->last[0], g->last[1]);
    return STAGE_REFUSED;
}

/* Stand for so long; what comes in meanwhile may be an alarm. */
static stage_code rest(stage *s, double seconds, errmsg *e)
{
    grbl_message m;
    stage_code r = grbl_take(s, &m, 0, now_s() + seconds, "settling", e);
    return r == STAGE_SILENT ? STAGE_OK : r;
}

static stage_code along(stage *s, const double (*path)[2], int n, double feed, double settle_s,
                        int *elsewhere, errmsg *e)
{
    grbl *g = s->state;
    double seconds = 0, from[2] = {g->last[0], g->last[1]};
    int late = 0;
    *elsewhere = 0;
    for (int k = 0; k < n; k++) {
        char line[GRBL_LINE_MAX + 2];
        grbl_format_move(line, sizeof line, path[k], feed);
        stage_code r = grbl_command(s, line, answer_s, "sending a move", e);
        if (r != STAGE_OK) return r;
        for (int a = 0; a < 2; a++) {
            double limit = s->facts.max_feed[a] > 0 ? fmin(feed, s->facts.max_feed[a]) : feed;
            seconds += fabs(path[k][a] - from[a]) / limit * 60;
            if (s->facts.acceleration[a] > 0) seconds += limit / 60 / s->facts.acceleration[a];
            from[a] = path[k][a];
        }
    }
    stage_code r = barrier(s, path[n - 1], settle_s, seconds, e);
    if (r == STAGE_OK && g->tells_modes) r = grbl_sync(s, "moving", e);
    if (r == STAGE_OK) r = confirm(s, path[n - 1], &late, elsewhere, e);
    if (r == STAGE_OK && (late || !g->tells_modes)) r = rest(s, settle_s, e);
    return r;
}

stage_code grbl_go(stage *s, const double (*path)[2], int n, double feed, double settle_s, errmsg *e)
{
    grbl *g = s->state;
    int lost = g->lost, elsewhere;
    s->under_way = 1;
    stage_code r = along(s, path, n, feed, settle_s, &elsewhere, e);
    if (r == STAGE_REFUSED && elsewhere && g->lost > lost)
        r = along(s, path, n, feed, settle_s, &elsewhere, e);
    if (r == STAGE_OK) s->under_way = 0;
    return r;
}
