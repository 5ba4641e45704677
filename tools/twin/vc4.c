/* vc4.c - see vc4.h. */
#include "vc4.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void say(vc4 *c, const char *text)
{
    size_t n = strlen(text);
    if (c->out_n + n > sizeof c->out) return;
    memcpy(c->out + c->out_n, text, n);
    c->out_n += n;
}

void vc4_init(vc4 *c, const long at[2], double step_rate)
{
    memset(c, 0, sizeof *c);
    memcpy(c->at, at, sizeof c->at);
    c->step_rate = step_rate;
    c->end = -1;
}

static void begin(vc4 *c, const long to[2], int done_bytes)
{
    long most = 0;
    for (int a = 0; a < 2; a++) {
        long d = labs(to[a] - c->at[a]);
        most = d > most ? d : most;
    }
    memcpy(c->from, c->at, sizeof c->from);
    memcpy(c->to, to, sizeof c->to);
    c->start = c->now;
    c->end = c->now + (double)most / c->step_rate + 1e-6;
    c->done_bytes = done_bytes;
}

/* m1f400m2r200n: each motor at most once, some motor. */
static int parse_move(long by[2], const char *p)
{
    int seen = 0;
    by[0] = by[1] = 0;
    while (*p == 'm') {
        int motor = p[1] - '1';
        if (motor < 0 || motor > 1 || (seen >> motor & 1) || (p[2] != 'f' && p[2] != 'r')) return -1;
        char *end;
        long n = p[3] >= '0' && p[3] <= '9' ? strtol(p + 3, &end, 10) : -1;
        if (n < 1) return -1;
        by[motor] = p[2] == 'f' ? n : -n;
        seen |= 1 << motor;
        p = end;
    }
    return seen && !strcmp(p, "n") ? 0 : -1;
}

static void line(vc4 *c)
{
    const long zero[2] = {0, 0};
    long by[2];
    if (!strcmp(c->line, "!1fp")) say(c, "C4 V1.0");
    else if (!strcmp(c->line, "!1h12")) begin(c, zero, 2);
    else if (!strcmp(c->line, "!1a")) {
        double s[2];
        int moving;
        vc4_truth(c, s, &moving);
        for (int a = 0; a < 2; a++) c->at[a] = lround(s[a]);
        c->end = -1;
    } else if (!strncmp(c->line, "!1", 2) && c->end < 0 && parse_move(by, c->line + 2) == 0) {
        const long to[2] = {c->at[0] + by[0], c->at[1] + by[1]};
        say(c, "a");
        begin(c, to, 1);
    } else say(c, "?");
}

void vc4_byte(vc4 *c, unsigned char byte)
{
    if (byte == '\r') {
        c->line[c->n] = 0;
        c->n = 0;
        line(c);
    } else if (c->n + 1 < sizeof c->line) c->line[c->n++] = (char)byte;
}

double vc4_next(const vc4 *c)
{
    return c->end >= 0 ? c->end : INFINITY;
}

void vc4_advance(vc4 *c, double now)
{
    if (c->end >= 0 && c->end <= now) {
        memcpy(c->at, c->to, sizeof c->at);
        for (int k = 0; k < c->done_bytes; k++) say(c, "o");
        c->end = -1;
    }
    c->now = now;
}

void vc4_truth(const vc4 *c, double steps[2], int *moving)
{
    *moving = c->end >= 0;
    for (int a = 0; a < 2; a++) {
        double f = *moving ? (c->now - c->start) / (c->end - c->start) : 0;
        steps[a] =
            *moving ? (double)c->from[a] + fmin(1, f) * (double)(c->to[a] - c->from[a]) : (double)c->at[a];
    }
}
