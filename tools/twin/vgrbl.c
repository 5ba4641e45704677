/* vgrbl.c - motion, alarms, resets and real-time bytes of the virtual controller. */
#include "vgrbl.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "vgrbl_internal.h"

static const double pull_off = 1; /* mm, from the switch after homing */

void vgrbl_say(vgrbl *g, const char *fmt, ...)
{
    va_list ap;
    size_t room = sizeof g->out - g->out_n;
    if (g->silent || g->unplugged) return;
    va_start(ap, fmt);
    int n = vsnprintf(g->out + g->out_n, room, fmt, ap);
    va_end(ap);
    if (n > 0 && (size_t)n < room) g->out_n += (size_t)n; /* what doesn't fit is lost, as on a real line */
}

void vgrbl_init(vgrbl *g, const vgrbl_settings *s, const double truth[2])
{
    memset(g, 0, sizeof *g);
    g->set = *s;
    memcpy(g->shift, truth, sizeof g->shift);
}

static void stop_dead(vgrbl *g)
{
    if (g->moving) vmove_position(g->belief, &g->move, g->now);
    g->moving = g->queued = 0;
    g->dwell_end = 0;
    g->waiting = 0;
    g->fault_time = 0;
}

static void banner(vgrbl *g)
{
    vgrbl_say(g, "\r\n%s ['$' for help]\r\n", g->set.hal ? "GrblHAL 1.1f" : "Grbl 1.1h");
    g->inch_mode = g->relative = g->motion = 0;
    g->ask_feed = 0;
    g->rx_n = 0;
    g->critical = g->door = 0;
    if (g->state == V_ALARM) vgrbl_say(g, "[MSG:'$H'|'$X' to unlock]\r\n");
    else {
        g->state = V_IDLE;
        vgrbl_startup_line(g);
    }
}

void vgrbl_power_up(vgrbl *g)
{
    double truth[2], speed;
    vgrbl_truth(g, truth, &speed);
    stop_dead(g);
    /* it wakes up believing that it stands at zero */
    g->belief[0] = g->belief[1] = 0;
    memcpy(g->shift, truth, sizeof truth);
    g->state = g->set.homing ? V_ALARM : V_IDLE;
    banner(g);
}

static void lose_steps(vgrbl *g)
{
    g->shift[0] += 0.37;
    g->shift[1] -= 0.23;
}

void vgrbl_alarm(vgrbl *g, int number, int critical)
{
    stop_dead(g);
    if (number != 2) lose_steps(g);
    g->state = V_ALARM;
    g->critical = critical;
    vgrbl_say(g, "ALARM:%d\r\n", number);
    /* GRBL stands still for half a second after an alarm, and clears what asked for a reset meanwhile */
    if (critical) g->deaf_until = g->now + 0.5;
}

static void reset(vgrbl *g)
{
    if (g->deaf_until > 0) return;
    if (g->state == V_SLEEP) g->state = V_ALARM;
    int pending = g->waiting != 0, homing = g->state == V_HOME,
        moving = g->state == V_RUN || g->state == V_HOLD;
    if (homing || (moving && g->moving)) vgrbl_alarm(g, homing ? 6 : 3, 0);
    else {
        stop_dead(g);
        if (g->state != V_ALARM) g->state = V_IDLE;
    }
    if (pending && g->set.late_ok) vgrbl_say(g, "ok\r\n");
    banner(g);
}

/* ---- motion ------------------------------------------------------------------------------------ */

static void begin_move(vgrbl *g, const double to[2], double feed)
{
    const vgrbl_settings *s = &g->set;
    double max_v[2] = {s->max_rate[0] / 60, s->max_rate[1] / 60};
    vmove_make(&g->move, g->belief, to, feed, max_v, s->acceleration, g->now);
    g->moving = 1;
    g->state = V_RUN;
    if (++g->moves == s->fault_at && s->fault != FAULT_NONE && s->fault != FAULT_ERROR9)
        g->fault_time = (g->move.start + vmove_end(&g->move)) / 2 + 1e-9;
}

int vgrbl_queue(vgrbl *g, const double to[2], double feed)
{
    double on_steps[2];
    for (int a = 0; a < 2; a++) on_steps[a] = round(to[a] * g->set.steps_per_mm[a]) / g->set.steps_per_mm[a];
    if (!g->moving && g->state == V_IDLE) {
        begin_move(g, on_steps, feed);
        return 1;
    }
    if (g->queued == VGRBL_PLANNER) return 0;
    memcpy(g->queue[g->queued], on_steps, sizeof on_steps);
    g->queue[g->queued++][2] = feed;
    return 1;
}

/* Time at which the stage hits its end of travel, with hard limits on. */
static double wall_time(const vgrbl *g)
{
    double lo = g->move.start, hi = vmove_end(&g->move);
    if (!g->moving || !g->set.hard_limits) return INFINITY;
    for (int pass = 0; pass < 60; pass++) {
        double mid = pass ? (lo + hi) / 2 : hi, xy[2];
        int out = 0;
        vmove_position(xy, &g->move, mid);
        for (int a = 0; a < 2; a++) {
            double t = xy[a] + g->shift[a];
            int low =
                g->set.home_direction >> a & 1; /* the homing switch itself; a buffer at the other end */
            out |= t >= (low ? 0.5 : -1e-9) || t <= -g->set.travel[a] - (low ? -1e-9 : 0.5);
        }
        if (!pass && !out) return INFINITY;
        if (out) hi = mid;
        else lo = mid;
    }
    return hi;
}

static void strike(vgrbl *g)
{
    g->fault_time = 0;
    switch (g->set.fault) {
    case FAULT_ALARM1: vgrbl_alarm(g, 1, 1); break;
    case FAULT_ALARM3: vgrbl_alarm(g, 3, 0); break;
    case FAULT_REBOOT:
        stop_dead(g);
        lose_steps(g);
        vgrbl_power_up(g);
        break;
    case FAULT_SILENCE: g->silent = 1; break;
    case FAULT_UNPLUG: g->unplugged = 1; break;
    case FAULT_SLIP: g->shift[0] += 2; break;
    case FAULT_HOLD:
    case FAULT_DOOR:
        vmove_hold(&g->move, g->now);
        g->state = V_HOLD;
        g->door = g->set.fault == FAULT_DOOR;
        break;
    default: /* those that strike when the line comes */ break;
    }
}

double vgrbl_next(const vgrbl *g)
{
    double t = INFINITY;
    if (g->moving && (g->state == V_RUN || g->state == V_HOLD)) t = fmin(t, vmove_end(&g->move));
    if (g->moving && g->state == V_RUN) t = fmin(t, wall_time(g));
    if (g->dwell_end > 0) t = fmin(t, g->dwell_end);
    if (g->state == V_HOME) t = fmin(t, g->home_end);
    if (g->fault_time > 0) t = fmin(t, g->fault_time);
    if (g->deaf_until > 0) t = fmin(t, g->deaf_until);
    return t;
}

static void home_done(vgrbl *g)
{
    if (g->set.z_first && g->home_axes == 3) {
        g->waiting = 0;
        vgrbl_alarm(g, 9, 0);
        banner(g);
        return;
    }
    for (int a = 0; a < 2; a++) {
        if (!(g->home_axes >> a & 1)) continue;
        int negative = g->set.home_direction >> a & 1;
        g->belief[a] = negative ? -g->set.travel[a] + pull_off : -pull_off;
        g->shift[a] = 0;
    }
    g->state = V_IDLE;
    g->waiting = 0;
    vgrbl_startup_line(g);
    vgrbl_say(g, "ok\r\n");
    vgrbl_lines(g);
}

static void move_done(vgrbl *g)
{
    if (g->state == V_HOLD) {
        g->state = g->door ? V_DOOR : V_HELD;
        return;
    }
    memcpy(g->belief, g->move.to, sizeof g->belief);
    g->moving = 0;
    if (g->queued > 0) {
        double next[3];
        memcpy(next, g->queue[0], sizeof next);
        memmove(g->queue, g->queue + 1, (size_t)--g->queued * sizeof *g->queue);
        begin_move(g, next, next[2]);
        if (g->waiting == 'p') {
            g->waiting = 0;
            vgrbl_queue(g, g->held_target, g->held_target[2]);
            vgrbl_say(g, "ok\r\n");
            vgrbl_lines(g);
        }
        return;
    }
    g->state = V_IDLE;
    if (g->waiting == 'd') g->dwell_end = g->now + fmax(g->dwell_s, 1e-6);
}

void vgrbl_advance(vgrbl *g, double now)
{
    for (double t; (t = vgrbl_next(g)) <= now;) {
        g->now = fmax(g->now, t);
        if (g->deaf_until > 0 && t >= g->deaf_until) {
            g->deaf_until = 0;
            vgrbl_say(g, "[MSG:Reset to continue]\r\n");
        } else if (g->fault_time > 0 && t >= g->fault_time) strike(g);
        else if (g->state == V_HOME) home_done(g);
        else if (g->moving && g->state == V_RUN && t >= wall_time(g)) vgrbl_alarm(g, 1, 1);
        else if (g->moving && (g->state == V_RUN || g->state == V_HOLD) && t >= vmove_end(&g->move))
            move_done(g);
        else if (g->dwell_end > 0) {
            g->dwell_end = 0;
            g->waiting = 0;
            vgrbl_say(g, "ok\r\n");
            vgrbl_lines(g);
        }
    }
    g->now = fmax(g->now, now);
}

void vgrbl_truth(const vgrbl *g, double xy[2], double *speed)
{
    *speed = 0;
    memcpy(xy, g->belief, 2 * sizeof *xy);
    if (g->moving) {
        vmove_position(xy, &g->move, g->now);
        vmove_at(&g->move, g->now, speed);
    }
    if (g->state == V_HOME) *speed = g->set.home_rate / 60;
    for (int a = 0; a < 2; a++) xy[a] += g->shift[a];
}

/* ---- real-time bytes ---------------------------------------------------------------------------- */

/* Homing switches that the stage stands on, as bits. */
static int switches(const vgrbl *g)
{
    double xy[2], speed;
    int bits = 0;
    vgrbl_truth(g, xy, &speed);
    for (int a = 0; a < 2; a++) {
        int low = g->set.home_direction >> a & 1;
        if (low ? xy[a] <= -g->set.travel[a] + 1e-9 : xy[a] >= -1e-9) bits |= 1 << a;
    }
    return bits;
}

static void status(vgrbl *g)
{
    static const char *const names[] = {"Idle",  "Run",    "Hold:1", "Hold:0", "Home",
                                        "Alarm", "Door:0", "Sleep",  "Check"};
    double xy[2], shift[2], speed, unit = g->set.inches ? 1 / 25.4 : 1;
    int decimals = g->set.inches ? 4 : 3, every = g->set.skip_status > 1 ? g->set.skip_status : 1;
    if (g->state == V_HOME || g->critical || g->queries++ % every != 0) return;
    memcpy(shift, g->shift, sizeof shift);
    vgrbl_truth(g, xy, &speed);
    for (int a = 0; a < 2; a++) {
        xy[a] -= shift[a];
        xy[a] = round(xy[a] * g->set.steps_per_mm[a]) / g->set.steps_per_mm[a];
        if (g->set.work_positions) xy[a] -= g->set.offset[a];
    }
    vgrbl_say(g, "<%s|%cPos:%.*f,%.*f,%.*f|FS:%.0f,0", names[g->state], g->set.work_positions ? 'W' : 'M',
              decimals, xy[0] * unit, decimals, xy[1] * unit, decimals, 0.0, speed * 60 * unit);
    int pressed = switches(g);
    if (pressed) vgrbl_say(g, "|Pn:%s%s", pressed & 1 ? "X" : "", pressed & 2 ? "Y" : "");
    if (g->queries % 10 == 3)
        vgrbl_say(g, "|WCO:%.*f,%.*f,%.*f", decimals, g->set.offset[0] * unit, decimals,
                  g->set.offset[1] * unit, decimals, 0.0);
    vgrbl_say(g, ">\r\n");
}

void vgrbl_byte(vgrbl *g, unsigned char byte)
{
    switch (byte) {
    case '?': status(g); return;
    case '!':
        if (g->state == V_RUN && g->moving && !g->door) {
            vmove_hold(&g->move, g->now);
            g->state = V_HOLD;
        } else if (g->state == V_IDLE) g->state = V_HELD;
        return;
    case '~':
        if (g->state == V_HELD) {
            g->state = V_IDLE;
            if (g->moving) {
                double to[2] = {g->move.to[0], g->move.to[1]}, v = g->move.v;
                vmove_position(g->belief, &g->move, g->now);
                g->moves--; /* the same move goes on */
                begin_move(g, to, v);
            }
        }
        return;
    case 0x18: reset(g); return;
    default: break;
    }
    if (byte >= 0x80) return;
    if (g->rx_n < sizeof g->rx) g->rx[g->rx_n++] = (char)byte;
    vgrbl_lines(g);
}
