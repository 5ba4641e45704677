/*
 * grbl_home.c - homing of the GRBL driver, how long it may take, the way out of an alarm, where the switches
 * are.
 *
 * GRBL homes each group of axes like this: towards the switch for at most 1.5 times the travel ($130) at the
 * seek rate ($25, but no faster than $110), off it by $27, again towards it for at most 5 times $27 at the
 * slow rate ($24), off it; and it rests $26 ms after each.  Meanwhile it is deaf to everything but a reset.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "deadline.h"
#include "grbl_drive.h"

/* Where the settings don't say how long it may take. */
static const double unknown_s = 120;

static const char *homing_of(const stage *s)
{
    return s->homing && s->homing[0] ? s->homing : "$H";
}

/* The longest that one homing command can take: its groups one after the other. */
static double longest(const stage *s, const char *command)
{
    const grbl *g = s->state;
    double t = 0;
    if (!(g->seek > 0 && g->locate > 0)) return unknown_s;
    for (int a = 0; a < 3; a++) {
        if (command[2] && !strchr(command + 2, "XYZ"[a])) continue;
        if (a == 2 && !(g->travel[2] > 0)) continue;
        if (!(g->travel[a] > 0)) return unknown_s;
        double v = (g->rate[a] > 0 ? fmin(g->seek, g->rate[a]) : g->seek) / 60;
        double slow = fmin(v, g->locate / 60);
        t += (1.5 * g->travel[a] + 2 * g->pull_off) / v + 5 * g->pull_off / slow + 4e-3 * g->debounce_ms;
        if (a < 2 && s->facts.acceleration[a] > 0) t += 4 * v / s->facts.acceleration[a];
    }
    return 1.25 * t + 10;
}

/* One homing command: over when a status says Idle after its ok, and for some time.  An ok alone proves
 * nothing: homing answers no query, or says Home.  *lost: Idle or Alarm a while after the beginning without
 * an ok, so its answer got lost, or the command did. */
static stage_code home_once(stage *s, const char *command, int *lost, errmsg *e)
{
    grbl_message m;
    char line[40];
    double needs = longest(s, command), limit = s->home_timeout_s > 0 ? s->home_timeout_s : needs;
    double start = now_s(), ask = start + ask_s;
    int answered = 0, idle = 0, alarmed = 0;
    *lost = 0;
    snprintf(line, sizeof line, "%s\n", command);
    stage_code r = grbl_send(s, line, "homing", e);
    while (r == STAGE_OK) {
        r = grbl_take(s, &m, WANT_ANSWER | WANT_STATUS, fmin(ask, start + limit), "homing", e);
        double now = now_s();
        if (r == STAGE_OK && m.kind == GRBL_OK) {
            if (!answered++) ask = now + 0.1;
        } else if (r == STAGE_OK) {
            idle = m.state == GRBL_IDLE ? idle + 1 : 0;
            alarmed = m.state == GRBL_ALARMED ? alarmed + 1 : 0;
            if (idle || alarmed) ask = fmin(ask, now + 0.1);
            *lost = !answered && (idle >= 3 || alarmed >= 3);
            if (*lost || (answered && idle >= 2)) return STAGE_OK;
            if (m.state != GRBL_ALARMED || alarmed >= 3) r = grbl_stuck(s, &m, "homing", e);
        } else if (r == STAGE_SILENT && now < start + limit) {
            r = grbl_realtime(s, GRBL_STATUS_QUERY, e);
            ask = now + ask_s;
        }
    }
    if (r == STAGE_SILENT && limit < needs)
        err_set(e, "stage: homing is not done after %.0f s; by $130, $131, $24 and $25 it may take %.0f s",
                limit, needs);
    else if (r == STAGE_SILENT) err_set(e, "stage: homing is not done after %.0f s", limit);
    return r;
}

/* What stock firmware does to a stage of two axes. */
static void hint_at(const char *command, int alarm, errmsg *e)
{
    const char *hint = NULL;
    char words[sizeof e->text];
    if ((alarm == 8 || alarm == 9) && !command[2])
        hint =
            "stock GRBL homes Z first, which a stage of two axes has not: build it with HOMING_CYCLE_0 for X "
            "and Y alone, or, where it homes single axes (HOMING_SINGLE_AXIS_COMMANDS, grblHAL), set "
            "homing = $HX $HY";
    else if (command[2] && !alarm) hint = "this firmware homes no single axes (HOMING_SINGLE_AXIS_COMMANDS)";
    if (!hint) return;
    snprintf(words, sizeof words, "%s", e->text);
    err_set(e, "%.600s; %s", words, hint);
}

/* A lost answer may be a lost command: it is done again, since homing twice is homing. */
static stage_code home_command(stage *s, const char *command, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    int lost;
    stage_code r = home_once(s, command, &lost, e);
    if (r == STAGE_OK && lost) {
        if (s->note) s->note("stage: the answer to homing was lost on the line; homing again");
        r = grbl_soft_reset(s, &m, e); /* and half a command with it */
        s->under_way = g->homing = 1;
        if (r == STAGE_OK) r = home_once(s, command, &lost, e);
        if (r == STAGE_OK && lost) {
            err_set(e, "stage: no answer to '%s', twice, though it is there", command);
            r = STAGE_REFUSED;
        }
    }
    if (r == STAGE_REFUSED) hint_at(command, g->alarm, e);
    return r;
}

stage_code grbl_home(stage *s, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double xy[2];
    stage_code r = g->need_reset ? grbl_soft_reset(s, &m, e) : STAGE_OK;
    if (r == STAGE_OK && !s->facts.can_home) {
        err_set(e, "stage: homing is switched off in the controller ($22=0)%s",
                s->locked ? "; it is in alarm: 'stagectl unlock' is the way out" : "");
        return STAGE_REFUSED;
    }
    if (r != STAGE_OK) return r;
    s->position_known = 0;
    s->under_way = g->homing = 1;
    g->alarm = 0;
    for (const char *p = homing_of(s); r == STAGE_OK && *p;) {
        char command[16];
        size_t n = strcspn(p, " ");
        snprintf(command, sizeof command, "%.*s", (int)n, p);
        if (n > 0) r = home_command(s, command, e);
        p += n + (p[n] == ' ');
    }
    if (r == STAGE_OK) g->homing = 0;
    /* Start-up lines run again after homing and may have changed the modes. */
    if (r == STAGE_OK) r = grbl_command(s, "G21G90G94G17G54\n", answer_s, "setting the modes", e);
    if (r == STAGE_OK) r = grbl_query(s, &m, xy, e);
    if (r != STAGE_OK) return r;
    s->position_known = 1;
    s->under_way = s->locked = 0;
    return STAGE_OK;
}

static stage_code unlock(stage *s, int *pressed, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double xy[2];
    stage_code r = g->need_reset ? grbl_soft_reset(s, &m, e) : STAGE_OK;
    if (r == STAGE_OK) r = grbl_command(s, "$X\n", answer_s, "unlocking", e);
    if (r == STAGE_OK) r = grbl_query(s, &m, xy, e);
    if (r == STAGE_OK) r = grbl_stuck(s, &m, "unlocking", e);
    if (r != STAGE_OK) return r;
    *pressed = m.limits & 3;
    g->alarm = s->locked = 0;
    return STAGE_OK;
}

stage_code grbl_unlock(stage *s, errmsg *e)
{
    grbl *g = s->state;
    int pressed;
    stage_code r = unlock(s, &pressed, e);
    if (r != STAGE_OK) return r;
    if (g->hard_limits && pressed && s->note)
        s->note("stage: a limit switch is still pressed: with $21=1 the controller locks again at each "
                "start, and as it "
                "leaves the switch; move the stage off it by hand, or home it");
    s->position_known = 1; /* the user's word */
    return STAGE_OK;
}

/* ---- where the switches are ------------------------------------------------------------------------ */

/* mm: first look, then closely; how far past the place where it should be to look at most. */
static const double coarse_mm = 0.25, fine_mm = 0.02, past_mm = 5, run_up_mm = 2;

/* Go there slowly.  A hard limit on the way is what is looked for: *hit, and out of the alarm again. */
static stage_code creep(stage *s, const double to[2], int *hit, unsigned *pressed, errmsg *e)
{
    grbl *g = s->state;
    grbl_message m;
    double xy[2];
    int limits;
    const double path[1][2] = {{to[0], to[1]}}, slow = g->locate > 0 ? fmax(g->locate, 30) : 60;
    const double feed = g->hard_limits ? slow : fmax(slow, 300); /* single steps stop by themselves */
    g->alarm = 0;
    stage_code r = grbl_go(s, path, 1, feed, 0, e);
    *hit = r == STAGE_REFUSED && g->alarm == 1;
    if (*hit) r = unlock(s, &limits, e); /* a stop from a creep loses no step; homing follows anyhow */
    if (*hit) s->under_way = 0;
    if (r == STAGE_OK) r = grbl_query(s, &m, xy, e);
    if (r == STAGE_OK) *pressed = (unsigned)m.limits;
    return r;
}

/* One axis: with hard limits a single slow move ends at the switch; without them it goes step by step, and
 * asks. */
static stage_code find_one(stage *s, int a, double at[2], double direction, double last, double *seen,
                           int *found, errmsg *e)
{
    grbl *g = s->state;
    int hit = 0;
    unsigned pressed = 0;
    double step = fmax(fine_mm, 1 / s->facts.steps_per_mm[a]), start = at[a];
    stage_code r = STAGE_OK;
    *found = 0;
    if (g->hard_limits) {
        at[a] = last;
        r = creep(s, at, &hit, &pressed, e);
        at[a] = g->last[a];
        *found = hit;
    } else {
        r = creep(s, at, &hit, &pressed, e);
        while (r == STAGE_OK && (pressed >> a & 1)) { /* it has drifted onto it: off it first */
            at[a] -= direction * fmax(g->pull_off, coarse_mm);
            if (fabs(at[a] - start) > past_mm + g->pull_off) break;
            r = creep(s, at, &hit, &pressed, e);
        }
        for (int fine = 0; r == STAGE_OK && fine < 2; fine++) {
            const double by = fine ? step : coarse_mm;
            if (fine) at[a] -= direction * 2 * coarse_mm;
            if (fine) r = creep(s, at, &hit, &pressed, e);
            for (int more = 1; r == STAGE_OK && more && !(pressed >> a & 1);) {
                double next = at[a] + direction * by;
                more = (last - next) * direction > 1e-9;
                at[a] = more ? next : last;
                r = creep(s, at, &hit, &pressed, e);
            }
            *found = (pressed >> a & 1) != 0;
            if (!*found) break;
        }
    }
    *seen = at[a];
    return r;
}

stage_code grbl_find_switches(stage *s, double seen[2], int found[2], errmsg *e)
{
    grbl *g = s->state;
    double at[2], end[2], direction[2], last[2];
    unsigned pressed;
    int hit;
    for (int a = 0; a < 2; a++) {
        direction[a] = g->home_direction >> a & 1 ? -1 : 1;
        end[a] = g->origin_at_home ? direction[a] * g->pull_off : direction[a] < 0 ? -g->travel[a] : 0;
        at[a] = end[a] - direction[a] * g->pull_off;
        last[a] = !g->soft_limits ? end[a] + direction[a] * past_mm : g->origin_at_home ? at[a] : end[a];
        seen[a] = at[a];
        found[a] = 0;
    }
    /* to where homing ends, at a move's speed; with hard limits but for the last millimetres */
    double before[2];
    for (int a = 0; a < 2; a++)
        before[a] = at[a] - direction[a] * (g->hard_limits ? fmin(run_up_mm, g->travel[a] / 2) : 0);
    const double path[1][2] = {{before[0], before[1]}};
    double feed = fmin(s->facts.max_feed[0], s->facts.max_feed[1]);
    stage_code r = grbl_go(s, path, 1, feed > 0 ? fmin(feed, 1500) : 600, 0, e);
    if (r == STAGE_OK && !g->hard_limits) r = creep(s, at, &hit, &pressed, e);
    for (int a = 0; a < 2 && r == STAGE_OK; a++) {
        if (g->hard_limits) { /* x stays on its switch: leaving it would be an alarm of its own */
            at[0] = a ? g->last[0] : before[0];
            at[1] = before[1];
        }
        r = find_one(s, a, at, direction[a], last[a], &seen[a], &found[a], e);
        if (r == STAGE_OK && !g->hard_limits) { /* off it again, so that only the other one is asked for */
            at[a] = end[a] - direction[a] * g->pull_off;
            r = creep(s, at, &hit, &pressed, e);
        }
    }
    if (g->hard_limits) s->position_known = 0; /* on the switches: home it */
    return r;
}
