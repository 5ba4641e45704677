/* vgrbl_lines.c - the virtual controller's line protocol: G-code of a stage, $ commands, their answers. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "vgrbl_internal.h"

typedef struct words {
    int absolute_machine, motion, units, distance, dwell; /* -1 = not there */
    double x, y, z, f, p;                                 /* NAN = not there */
} words;

static double *slot(words *w, char letter)
{
    switch (letter) {
    case 'X': return &w->x;
    case 'Y': return &w->y;
    case 'Z': return &w->z;
    case 'F': return &w->f;
    case 'P': return &w->p;
    default: return NULL;
    }
}

/* GRBL's error number, 0 = fine. */
static int take_g(words *w, double v)
{
    if (v != floor(v)) return 20;
    switch ((int)v) {
    case 0:
    case 1:
        if (w->motion >= 0) return 21;
        w->motion = (int)v;
        return 0;
    case 4: w->dwell = 1; return 0;
    case 20:
    case 21: w->units = (int)v == 20; return 0;
    case 53: w->absolute_machine = 1; return 0;
    case 90:
    case 91: w->distance = (int)v == 91; return 0;
    case 17:
    case 54:
    case 94: return 0;
    default: return 20;
    }
}

static int parse(words *w, const char *line)
{
    *w = (words){0, -1, -1, -1, 0, NAN, NAN, NAN, NAN, NAN};
    for (const char *p = line; *p;) {
        char letter = (char)toupper((unsigned char)*p), *end;
        if (*p == ' ') {
            p++;
            continue;
        }
        if (!isalpha((unsigned char)letter)) return 1;
        double v = strtod(p + 1, &end);
        if (end == p + 1 || !isfinite(v) || toupper((unsigned char)p[1]) == 'I' ||
            toupper((unsigned char)p[1]) == 'N')
            return 2;
        p = end;
        int bad = 0;
        if (letter == 'G') bad = take_g(w, v);
        else if (slot(w, letter)) {
            if (!isnan(*slot(w, letter))) return 25;
            *slot(w, letter) = v;
        } else if (letter != 'N') bad = 20;
        if (bad) return bad;
    }
    return 0;
}

/* Run one block.  Error number, 0 = ok, -1 = the answer comes later or never. */
static int run(vgrbl *g, const char *line)
{
    words w;
    int bad = parse(&w, line), has_axis = 0;
    if (bad) return bad;
    if (w.units >= 0) g->inch_mode = w.units;
    double unit = g->inch_mode ? 25.4 : 1;
    if (w.distance >= 0) g->relative = w.distance;
    if (w.motion >= 0) g->motion = w.motion;
    if (!isnan(w.f)) {
        if (w.f < 0) return 4;
        g->ask_feed = w.f * unit;
    }
    has_axis = !isnan(w.x) || !isnan(w.y) || !isnan(w.z);
    if (w.dwell) {
        if (isnan(w.p)) return 28;
        if (w.p < 0) return 4;
        g->dwell_s = w.p;
        g->waiting = 'd';
        if (!g->moving) g->dwell_end = g->now + fmax(g->dwell_s, 1e-6);
        return -1;
    }
    if (!has_axis) return w.absolute_machine ? 26 : 0;
    if (g->state == V_CHECK) return 0;
    if (g->motion == 1 && !(g->ask_feed > 0)) return 22;
    double at[2], to[2], given[2] = {w.x, w.y};
    /* the planner's end, not where the stage is just now */
    if (g->queued > 0) memcpy(at, g->queue[g->queued - 1], sizeof at);
    else memcpy(at, g->moving ? g->move.to : g->belief, sizeof at);
    for (int a = 0; a < 2; a++) {
        double base = w.absolute_machine ? 0 : g->relative ? at[a] : g->set.offset[a];
        to[a] = isnan(given[a]) ? at[a] : base + given[a] * unit;
    }
    if (g->set.soft_limits && g->set.homing)
        for (int a = 0; a < 2; a++)
            if (to[a] > 1e-6 || to[a] < -g->set.travel[a] - 1e-6) {
                vgrbl_alarm(g, 2, 1);
                return -1;
            }
    if (g->set.fault == FAULT_ERROR9 && g->moves + g->queued + 1 == g->set.fault_at) {
        g->moves++;
        g->state = V_ALARM;
        return 9;
    }
    int strikes = g->moves + g->queued + 1 == g->set.fault_at;
    if (strikes && (g->set.fault == FAULT_SLEEP || g->set.fault == FAULT_CHECK)) {
        g->moves++;
        g->state = g->set.fault == FAULT_SLEEP ? V_SLEEP : V_CHECK;
        return g->state == V_SLEEP ? -1 : 0;
    }
    if (strikes && g->set.fault == FAULT_STRAY) vgrbl_say(g, "ok\r\n");
    g->garble = strikes && g->set.fault == FAULT_GARBLE;
    double feed = g->motion == 0 ? INFINITY : g->ask_feed / 60;
    if (vgrbl_queue(g, to, feed)) return 0;
    memcpy(g->held_target, to, sizeof to);
    g->held_target[2] = feed;
    g->waiting = 'p';
    return -1;
}

void vgrbl_startup_line(vgrbl *g)
{
    if (!g->set.startup || g->state == V_ALARM) return;
    int bad = run(g, g->set.startup);
    if (bad > 0) vgrbl_say(g, ">%s:error:%d\r\n", g->set.startup, bad);
    else vgrbl_say(g, ">%s:ok\r\n", g->set.startup);
}

static void settings(vgrbl *g)
{
    const vgrbl_settings *s = &g->set;
    vgrbl_say(g,
              "$0=10\r\n$1=%d\r\n$2=0\r\n$3=0\r\n$4=0\r\n$5=0\r\n$6=0\r\n$10=%d\r\n$11=0.010\r\n$12=0."
              "002\r\n$13=%d\r\n",
              s->idle_delay, s->work_positions ? 0 : 1, s->inches);
    vgrbl_say(g,
              "$20=%d\r\n$21=%d\r\n$22=%d\r\n$23=%d\r\n$24=25.000\r\n$25=%.3f\r\n$26=250\r\n$27=1.000\r\n$30="
              "1000\r\n$31=0\r\n$32=0\r\n",
              s->soft_limits, s->hard_limits, s->homing, s->home_direction, s->home_rate);
    for (int a = 0; a < 2; a++) vgrbl_say(g, "$%d=%.3f\r\n", 100 + a, s->steps_per_mm[a]);
    for (int a = 0; a < 2; a++) vgrbl_say(g, "$%d=%.3f\r\n", 110 + a, s->max_rate[a]);
    for (int a = 0; a < 2; a++) vgrbl_say(g, "$%d=%.3f\r\n", 120 + a, s->acceleration[a]);
    for (int a = 0; a < 2; a++) vgrbl_say(g, "$%d=%.3f\r\n", 130 + a, s->travel[a]);
}

/* A $ command: error number, 0 = ok, -1 = later. */
static int dollar(vgrbl *g, const char *line)
{
    int quiet = g->state == V_IDLE || g->state == V_ALARM;
    if (!strcmp(line, "$X")) {
        if (g->state == V_ALARM) g->state = V_IDLE;
        return 0;
    }
    if (!strcmp(line, "$H") || (g->set.single_axis && (!strcmp(line, "$HX") || !strcmp(line, "$HY")))) {
        if (!g->set.homing) return 5;
        if (!quiet) return 8;
        double speed, longest = 0;
        vgrbl_truth(g, g->home_from, &speed);
        g->home_axes = line[2] == 'X' ? 1 : line[2] == 'Y' ? 2 : 3;
        for (int a = 0; a < 2; a++) {
            if (!(g->home_axes >> a & 1)) continue;
            double end = g->set.home_direction >> a & 1 ? -g->set.travel[a] : 0;
            longest = fmax(longest, fabs(end - g->home_from[a]));
        }
        g->state = V_HOME;
        g->waiting = 'h';
        g->home_end = g->now + longest / (g->set.home_rate / 60) + 3; /* and the slow approach */
        return -1;
    }
    if (!strcmp(line, "$G")) { /* at any time */
        vgrbl_say(g, "[GC:G%d G54 G17 G%d G%d G94 M5 M9 T0 F%.0f S0]\r\n", g->motion, g->inch_mode ? 20 : 21,
                  g->relative ? 91 : 90, g->ask_feed);
        return 0;
    }
    if (!quiet) return 8;
    if (!strcmp(line, "$$")) settings(g);
    else if (!strcmp(line, "$I")) vgrbl_say(g, "[VER:1.1h.20190825:]\r\n[OPT:V,15,128]\r\n");
    else return 3;
    return 0;
}

void vgrbl_line(vgrbl *g, char *line)
{
    int bad;
    if (line[0] == '$') bad = dollar(g, line);
    else if (line[0] == 0) bad = 0;
    else bad = g->state == V_ALARM ? 9 : run(g, line);
    if (bad == 0) vgrbl_say(g, g->garble ? "o\x7f{\r\n" : "ok\r\n");
    g->garble = 0;
    if (bad <= 0) return;
    vgrbl_say(g, "error:%d\r\n", bad);
}

/* Lines wait while a command is under way whose answer is due first. */
void vgrbl_lines(vgrbl *g)
{
    while (!g->waiting && !g->critical && g->state != V_HELD && g->state != V_HOLD && g->state != V_DOOR &&
           g->state != V_SLEEP) {
        size_t n = 0;
        while (n < g->rx_n && g->rx[n] != '\n' && g->rx[n] != '\r') n++;
        if (n == g->rx_n) {
            if (n == sizeof g->rx) { /* overflow: the line is lost */
                g->rx_n = 0;
                vgrbl_say(g, "error:11\r\n");
            }
            return;
        }
        char line[VGRBL_RX + 1];
        memcpy(line, g->rx, n);
        line[n] = 0;
        memmove(g->rx, g->rx + n + 1, g->rx_n - n - 1);
        g->rx_n -= n + 1;
        if (n > 79) vgrbl_say(g, "error:11\r\n");
        else vgrbl_line(g, line);
    }
}
