/*
 * c4.c - driver for the Arrick MD-2 stage (the paper's) through its C4 controller.  Inferred, unverified on
 * hardware.
 *
 * The controller counts relative half steps and reports no position, so the host counts; after anything
 * that ends a move early the position is unknown until the stage is homed.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "c4_proto.h"
#include "deadline.h"
#include "signals.h"
#include "stage.h"

static const double home_s = 120, send_s = 5, accept_s = 2, slow_steps_per_s = 50;

typedef struct c4 {
    long at[2]; /* half steps from home */
} c4;

static stage_code say(stage *s, const char *text, size_t n, int ignore_interrupt, const char *doing,
                      errmsg *e)
{
    return stage_port_error(e, port_send(s->port, text, n, now_s() + send_s, ignore_interrupt), doing);
}

/* One answer byte; blanks and line ends that a cable or a terminal server adds are passed over. */
static stage_code hear(stage *s, char want, double deadline, const char *doing, errmsg *e)
{
    for (;;) {
        char byte;
        size_t got;
        port_result r = port_receive(s->port, &byte, 1, &got, deadline);
        if (r != PORT_OK) return stage_port_error(e, r, doing);
        if (byte == want) return STAGE_OK;
        if (byte == '\r' || byte == '\n' || byte == ' ' || byte == 0) continue;
        err_set(e, "stage: expected '%c' while %s, found '%c' (0x%02x)", want, doing, byte,
                (unsigned)(unsigned char)byte);
        s->position_known = 0;
        return STAGE_REFUSED;
    }
}

static stage_code c4_connect(stage *s, errmsg *e)
{
    char text[32];
    size_t n = 0;
    s->state = calloc(1, sizeof(c4));
    if (!s->state) {
        err_set(e, "out of memory");
        return STAGE_FAILED;
    }
    for (int a = 0; a < 2; a++) {
        if (!(s->stated_steps_per_mm[a] > 0)) {
            err_set(e, "stage: expected steps_per_mm for driver c4 (7.874016 direct, 19.68504 with the 2.5:1 "
                       "reducer)");
            return STAGE_REFUSED;
        }
        s->facts.steps_per_mm[a] = s->stated_steps_per_mm[a];
    }
    s->facts.can_home = 1;
    stage_code r = say(s, "!1fp\r", 5, 0, "asking what the controller is", e);
    double deadline = now_s() + accept_s;
    while (r == STAGE_OK && n < sizeof text - 1) {
        size_t got;
        port_result p = port_receive(s->port, text + n, sizeof text - 1 - n, &got, deadline);
        if (p == PORT_TIMEOUT) break;
        r = stage_port_error(e, p, "asking what the controller is");
        if (p == PORT_OK) n += got;
        deadline = now_s() + 0.3; /* no line end: silence ends the answer */
    }
    if (r != STAGE_OK) return r;
    text[n] = 0;
    if (n == 0) return stage_port_error(e, PORT_TIMEOUT, "asking what the controller is");
    const char *c = strstr(text, "C4");
    if (!c) {
        err_set(e, "stage: expected a C4 controller, found '%s'", text);
        return STAGE_REFUSED;
    }
    snprintf(s->facts.ident, sizeof s->facts.ident, "%.*s", (int)strcspn(c, "\r\n"), c);
    return STAGE_OK;
}

static stage_code c4_home(stage *s, errmsg *e)
{
    c4 *c = s->state;
    port_discard(s->port);
    s->position_known = 0;
    s->under_way = 1;
    stage_code r = say(s, "!1h12\r", 6, 0, "homing", e);
    double deadline = now_s() + (s->home_timeout_s > 0 ? s->home_timeout_s : home_s);
    for (int k = 0; k < 2 && r == STAGE_OK; k++) r = hear(s, 'o', deadline, "homing", e);
    if (r != STAGE_OK) return r;
    c->at[0] = c->at[1] = 0;
    s->position_known = 1;
    s->under_way = 0;
    return STAGE_OK;
}

static stage_code wait_still(stage *s, double seconds, errmsg *e)
{
    /* The line is silent while the stage stands: a byte now is an answer too many. */
    char byte;
    size_t got;
    port_result r = port_receive(s->port, &byte, 1, &got, now_s() + seconds);
    if (r == PORT_TIMEOUT) return STAGE_OK;
    if (r != PORT_OK) return stage_port_error(e, r, "settling");
    err_set(e, "stage: unexpected answer '%c' (0x%02x)", byte, (unsigned)(unsigned char)byte);
    s->position_known = 0;
    return STAGE_REFUSED;
}

static stage_code c4_go(stage *s, const double (*path)[2], int n, double feed, double settle_s, errmsg *e)
{
    c4 *c = s->state;
    (void)feed; /* the controller's own */
    for (int k = 0; k < n; k++) {
        char line[80];
        long to[2], by[2];
        for (int a = 0; a < 2; a++) {
            to[a] = c4_steps(path[k][a], s->facts.steps_per_mm[a]);
            by[a] = to[a] - c->at[a];
        }
        size_t len = c4_format_move(line, sizeof line, by);
        if (len == 0) continue;
        int known = s->position_known;
        s->position_known = 0; /* until the answer says that it got there */
        s->under_way = 1;
        stage_code r = say(s, line, len, 0, "sending a move", e);
        if (r == STAGE_OK) r = hear(s, 'a', now_s() + accept_s, "waiting for a move to be taken", e);
        double most = (double)(labs(by[0]) + labs(by[1]));
        if (r == STAGE_OK) r = hear(s, 'o', now_s() + 10 + most / slow_steps_per_s, "moving", e);
        if (r != STAGE_OK) return r;
        memcpy(c->at, to, sizeof to);
        s->position_known = known;
        s->under_way = 0;
    }
    return wait_still(s, settle_s, e);
}

static stage_code c4_where(stage *s, double xy[2], char state[32], errmsg *e)
{
    c4 *c = s->state;
    (void)e;
    for (int a = 0; a < 2; a++) xy[a] = (double)c->at[a] / s->facts.steps_per_mm[a];
    snprintf(state, 32, "%s", s->position_known ? "counted" : "unknown");
    return STAGE_OK;
}

static stage_code c4_check(stage *s, errmsg *e)
{
    return wait_still(s, 0, e);
}

static stage_code c4_halt(stage *s, errmsg *e)
{
    if (s->position_known && !s->under_way) return STAGE_OK; /* known only while it stands */
    s->under_way = 0;
    return say(s, "!1a\r", 4, 1, "stopping", e);
}

static void c4_assume(stage *s, const double xy[2])
{
    c4 *c = s->state;
    for (int a = 0; a < 2; a++) c->at[a] = c4_steps(xy[a], s->facts.steps_per_mm[a]);
    s->position_known = 1;
}

static void c4_release(stage *s)
{
    free(s->state);
    s->state = NULL;
}

const stage_driver stage_driver_c4 = {
    .name = "c4",
    .about = "Arrick MD-2 through its C4 controller, 9600 baud (inferred, unverified on hardware)",
    .baud = C4_BAUD,
    .connect = c4_connect,
    .home = c4_home,
    .go = c4_go,
    .where = c4_where,
    .check = c4_check,
    .halt = c4_halt,
    .assume = c4_assume,
    .release = c4_release};
