/*
 * capture_stage.c - see capture_stage.h.
 *
 * A controller that counts open loop can be wrong about where it stands in two ways: it has restarted and
 * counts from another zero, or steps were lost.  The first shows in the position that it reports against the
 * journal's; the second at the homing switches, which have not moved.
 */
#include "capture_stage.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "signals.h"
#include "trying.h"

/* The switches are looked for in steps of 0.02 mm, and come back to some hundredths. */
static const double drift_mm = 0.05;

static void say(const capture_run *r, const char *words)
{
    if (r->say) r->say(words);
}

static int check_travel(const capture_run *r, errmsg *e)
{
    const session *s = r->s;
    const stage_facts *f = &r->stage->facts;
    const double *t = s->travel, lo[2] = {t[0], t[2]}, hi[2] = {t[1], t[3]};
    int stated = t[0] < t[1] || t[2] < t[3];
    errmsg why;
    if (f->has_travel && plan_check_travel(s, f->lo, f->hi, &why) != 0)
        return err_set(e, "%s%s", why.text,
                       f->margin_mm > 0
                           ? " (the switch, and $27 before it, is out of bounds: with $21=1 it is an alarm)"
                           : "");
    if (stated) return plan_check_travel(s, lo, hi, e);
    if (!f->has_travel)
        say(r, "travel not checked: the controller doesn't say and [stage] travel is not given");
    return 0;
}

/* ---- where a controller that was left alone may stand -------------------------------------------- */

static double from_segment(const double p[2], const double a[2], const double b[2])
{
    double d[2] = {b[0] - a[0], b[1] - a[1]}, q[2] = {p[0] - a[0], p[1] - a[1]};
    double n = d[0] * d[0] + d[1] * d[1], t = n > 0 ? fmin(1, fmax(0, (d[0] * q[0] + d[1] * q[1]) / n)) : 0;
    return hypot(q[0] - t * d[0], q[1] - t * d[1]);
}

/* At the last place on record, or on the way to one that was begun: a killed run leaves the stage there. */
static int may_stand(const capture_run *r, const double at[2], const double last[2])
{
    const session *s = r->s;
    const double *steps = r->stage->facts.steps_per_mm;
    const double near_mm = 2 / fmin(steps[0], steps[1]) + 0.005;
    if (from_segment(at, last, last) <= near_mm && !r->stage->restarted) return 1;
    int begun = 0, on_way = 0;
    for (long k = 0; k < plan_places(s); k++) {
        place p;
        plan_place(&p, s, k);
        const journal_place *jp = journal_at(r->j, p.i, p.j);
        if (!jp->begun || jp->done) continue;
        begun += !jp->has_arrived;
        for (int known = 0; known < 2; known++) {
            double path[2][2];
            int n = plan_path(path, s, known ? last : NULL, p.machine);
            on_way |= from_segment(at, last, path[0]) <= near_mm ||
                      from_segment(at, path[0], path[n - 1]) <= near_mm;
        }
    }
    if (r->stage->restarted) return !begun && from_segment(at, last, last) <= near_mm;
    return on_way;
}

static stage_code compare_position(const capture_run *r, const double last[2], errmsg *e)
{
    stage *st = r->stage;
    double at[2];
    char state[32];
    if (!st->facts.reports_position) return STAGE_OK;
    stage_code c = st->driver->where(st, at, state, e);
    if (c != STAGE_OK || may_stand(r, at, last)) return c;
    char way[256];
    if (st->facts.can_home) snprintf(way, sizeof way, "home it: leave --assume-position out");
    else
        snprintf(way, sizeof way,
                 "set the stage to its zero by hand, restart the controller there, 'stagectl move %.3f "
                 "%.3f', then "
                 "--assume-position again",
                 last[0], last[1]);
    err_set(e,
            "stage: expected it at %.3f %.3f mm, where the journal saw it last, found %.3f %.3f: the "
            "controller has "
            "restarted%s and counts from another zero, or it was moved; %s",
            last[0], last[1], at[0], at[1], st->restarted ? " (opening the port did it)" : "", way);
    return STAGE_REFUSED;
}

/* ---- homing ----------------------------------------------------------------------------------------- */

static stage_code find(capture_run *r, double seen[2], int found[2], errmsg *e)
{
    stage *st = r->stage;
    stage_code c = STAGE_OK;
    found[0] = found[1] = 0;
    if (st->driver->find_switches) c = st->driver->find_switches(st, seen, found, e);
    return c;
}

static stage_code home(capture_run *r, errmsg *e)
{
    stage *st = r->stage;
    capture_show(r, "homing");
    stage_code c = st->driver->home(st, e);
    if (c != STAGE_OK || !r->s->check_home || r->has_baseline) return c;
    r->has_baseline = 1;
    c = find(r, r->switch_at, r->has_switch, e);
    if (c == STAGE_OK && !(r->has_switch[0] && r->has_switch[1]))
        say(r, "check_home: the controller doesn't show both homing switches where it homes (Pn: in its "
               "status; $20=1 "
               "keeps it from going there): drift is seen towards them only");
    if (c == STAGE_OK && (st->locked || !st->position_known)) c = st->driver->home(st, e);
    return c;
}

static stage_code find_position(capture_run *r, errmsg *e)
{
    const session *s = r->s;
    stage *st = r->stage;
    const double *last = journal_last_arrived(r->j), zero[2] = {0, 0};
    int assume = r->assume_position || (!s->home && !last);
    if (assume && st->locked) {
        err_set(e, "stage: it is in alarm: %s'stagectl unlock' if it stands where it says",
                st->facts.can_home ? "home it, or " : "homing is switched off ($22=0); ");
        return STAGE_REFUSED;
    }
    if (assume) {
        stage_code c = last ? compare_position(r, last, e) : STAGE_OK;
        if (c == STAGE_OK) st->driver->assume(st, last ? last : zero);
        return c;
    }
    if (!s->home) {
        err_set(
            e,
            "stage: the session has home = no: resume with --assume-position if the stage has kept its zero");
        return STAGE_FAILED;
    }
    return home(r, e);
}

stage_code capture_ready_stage(capture_run *r, errmsg *e)
{
    const session *s = r->s;
    stage *st = r->stage;
    char words[300];
    st->home_timeout_s = s->home_timeout;
    st->homing = s->homing;
    st->baud = r->baud > 0 ? r->baud : s->baud;
    st->dtr_off = r->dtr_off || !s->dtr;
    memcpy(st->stated_steps_per_mm, s->steps_per_mm, sizeof st->stated_steps_per_mm);
    capture_show(r, "connecting");
    stage_code c = stage_open(st, stage_driver_by_name(s->driver), trying_port(r), e);
    r->trying.port_failed = c == STAGE_FAILED;
    if (c != STAGE_OK) return c;
    trying_port_open(r);
    const double *before = journal_steps(r->j), *now = st->facts.steps_per_mm;
    if (before && (before[0] != now[0] || before[1] != now[1])) {
        err_set(e, "stage: expected %g x %g steps/mm as when the session began, found %g x %g", before[0],
                before[1], now[0], now[1]);
        return STAGE_FAILED;
    }
    if (!before && journal_set_steps(r->j, now, e) != 0) return STAGE_FAILED;
    if (check_travel(r, e) != 0) return STAGE_FAILED;
    if (motors_words(words, sizeof words, &st->facts)) say(r, words);
    c = find_position(r, e);
    if (c == STAGE_OK) r->was_known = 1;
    return c;
}

/* ---- on the way ------------------------------------------------------------------------------------- */

/* What the axes' switches say, in words that go on from those there are.  Number of axes amiss. */
static int tell_drift(char *words, size_t room, const capture_run *r, const double seen[2],
                      const int found[2])
{
    int amiss = 0;
    for (int a = 0; a < 2; a++) {
        size_t n = strlen(words);
        double by = seen[a] - r->switch_at[a];
        if (!r->has_switch[a] && !found[a]) continue;
        if (found[a] && r->has_switch[a] && fabs(by) <= drift_mm) continue;
        if (found[a])
            snprintf(words + n, room - n,
                     "%s %c has drifted by %.2f mm (it stands at %+.2f of what is reported)",
                     amiss ? " and" : "", "xy"[a], fabs(by), -by);
        else
            snprintf(words + n, room - n,
                     "%s %c has drifted away from its switch (how far can't be seen: with $20=1 the "
                     "controller goes no further)",
                     amiss ? " and" : "", "xy"[a]);
        amiss++;
    }
    return amiss;
}

stage_code capture_check_home(capture_run *r, long index, errmsg *e)
{
    double seen[2];
    int found[2];
    char words[600] = "check_home:";
    if (!r->stage->port) return STAGE_OK; /* nothing was left to take */
    capture_show(r, "looking for the switches");
    stage_code c = find(r, seen, found, e);
    if (c == STAGE_OK) c = home(r, e); /* with --assume-position this finds out where they should be */
    if (c != STAGE_OK) return c;
    if (tell_drift(words, sizeof words, r, seen, found)) {
        place first, last;
        size_t n = strlen(words);
        plan_place(&first, r->s, r->doubt_from);
        plan_place(&last, r->s, index);
        snprintf(words + n, sizeof words - n, ": the %ld places from %d,%d to %d,%d are in doubt",
                 r->unchecked, first.i, first.j, last.i, last.j);
        say(r, words);
        r->in_doubt += r->unchecked;
    }
    r->unchecked = 0;
    return STAGE_OK;
}

void capture_leave_stage(capture_run *r, stage_code why)
{
    stage *st = r->stage;
    errmsg words;
    double at[2];
    char state[32];
    if (!st->port || why == STAGE_GONE) return;
    if (why == STAGE_INTERRUPTED) signals_acknowledge();
    stage_code c = st->driver->halt(st, &words);
    if (c != STAGE_OK && c != STAGE_INTERRUPTED) say(r, words.text);
    else if (!st->position_known && r->was_known) say(r, "stage: its position is lost");
    else if (r->was_known && st->position_known && st->facts.reports_position &&
             st->driver->where(st, at, state, &words) == STAGE_OK && journal_stopped(r->j, at, &words) != 0)
        say(r, words.text);
}
