/* stagectl_show.c - see stagectl_show.h. */
#include "stagectl_show.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/cli.h"
#include "camerawords.h"
#include "chaincheck.h"
#include "depends.h"
#include "names.h"
#include "plan.h"
#include "positions.h"
#include "rounds.h"
#include "stage.h"

void load_session(session *s, const char *path)
{
    errmsg e;
    if (session_load(s, path, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
}

static void print_time(const char *what, double s)
{
    printf("%-12s%d h %02d min %04.1f s\n", what, (int)(s / 3600), (int)(fmod(s, 3600) / 60), fmod(s, 60));
}

double free_bytes(const char *folder)
{
    char path[4096];
    struct statvfs v;
    if (strlen(folder) >= sizeof path) return -1;
    strcpy(path, folder);
    while (statvfs(path, &v) != 0) {
        char *slash = strrchr(path, '/');
        if (!slash || slash == path)
            return statvfs(slash ? "/" : ".", &v) == 0 ? (double)v.f_bavail * (double)v.f_frsize : -1;
        *slash = 0;
    }
    return (double)v.f_bavail * (double)v.f_frsize;
}

/* What a controller that is there says of itself; it is not reset, nor disturbed when it is at work.  No
 * port, or nobody there: 0 with words. */
static int ask_controller(stage_facts *f, const session *s, const char *device, errmsg *e)
{
    stage st = {.home_timeout_s = s->home_timeout, .baud = s->baud, .dtr_off = !s->dtr, .look_only = 1};
    memcpy(st.stated_steps_per_mm, s->steps_per_mm, sizeof st.stated_steps_per_mm);
    if (!device || !device[0] || (strncmp(device, "tcp:", 4) != 0 && access(device, F_OK) != 0)) {
        err_set(e, "%s", device && device[0] ? "not there" : "no port given");
        return 0;
    }
    if (stage_open(&st, stage_driver_by_name(s->driver), device, e) != STAGE_OK) return 0;
    *f = st.facts;
    stage_close(&st);
    return 1;
}

static void print_travel(const session *s, const stage_facts *f, const char *path)
{
    const double lo[2] = {s->travel[0], s->travel[2]}, hi[2] = {s->travel[1], s->travel[3]};
    int stated = lo[0] < hi[0] || lo[1] < hi[1];
    errmsg e;
    if (f->has_travel && plan_check_travel(s, f->lo, f->hi, &e) != 0)
        cli_fail(CLI_FAILED, "%s: %s%s", path, e.text,
                 f->margin_mm > 0 ? " ($27 off the switch: with $21=1 it is an alarm)" : "");
    if (stated && plan_check_travel(s, lo, hi, &e) != 0) cli_fail(CLI_FAILED, "%s: %s", path, e.text);
    printf("travel      %s\n",
           stated || f->has_travel ? "all points inside" : "not checked: [stage] travel is not given");
}

/* What an adaptive capture may come to; the chain's own time between rounds is not known. */
static void print_rounds(const session *s, const plan_totals *t, const char *path)
{
    char command[8192];
    errmsg e;
    const long most = positions_most(s) > t->places ? positions_most(s) : t->places;
    printf(
        "adaptive    %ld places are listed; more where the lamps are least certain, until light is uncertain "
        "by %g %%\n            or there are %ld\n",
        t->places, 100 * s->positions_error, most);
    print_time("at most", t->total_s * (double)most / (double)t->places);
    printf("            and the chain's work and homing between rounds; %.1f MB on disk\n",
           t->bytes * (double)most / (double)t->places / 1e6);
    if (rounds_command(command, s, path, &e) != 0) cli_fail(CLI_FAILED, "%s: %s", path, e.text);
    printf("next        %s\n", command);
}

int show_plan(const char *path, const char *device)
{
    session s;
    plan_totals t;
    plan_limits limits = {{0}, {0}};
    stage_facts f = {.motors_rest_ms = -1};
    errmsg e;
    load_session(&s, path);
    int there = ask_controller(&f, &s, device && device[0] ? device : s.port, &e);
    if (there) {
        memcpy(limits.max_feed, f.max_feed, sizeof limits.max_feed);
        memcpy(limits.acceleration, f.acceleration, sizeof limits.acceleration);
    }
    plan_sum(&t, &s, &limits);
    printf("places      %ld (%s%d x %d)\nexposures   %ld (%d a place, %g to %g s%s)\n", t.places,
           s.listed ? "of " : "", s.nodes[0], s.nodes[1], t.exposures, s.exposures, s.exposure[0],
           s.exposure[s.exposures - 1], s.adaptive ? "; auto: at most" : "");
    printf("moves       %ld, %.1f mm, x %g to %g, y %g to %g mm\n", t.moves, t.distance_mm, t.lo[0], t.hi[0],
           t.lo[1], t.hi[1]);
    print_time("moving", t.move_s);
    print_time("settling", t.settle_s);
    print_time("exposing", t.exposure_s + t.overhead_s);
    print_time("in all", t.total_s);
    if (positions_adaptive(&s)) print_rounds(&s, &t, path);
    double room = free_bytes(s.folder);
    printf("disk        %.1f MB", t.bytes / 1e6);
    if (room >= 0) printf(" of %.1f MB free%s", room / 1e6, room < t.bytes ? ": NOT ENOUGH" : "");
    printf("\n");
    if (there) {
        printf("controller  %s: at most %g and %g mm/min, %g and %g mm/s2\n", f.ident, f.max_feed[0],
               f.max_feed[1], f.acceleration[0], f.acceleration[1]);
        char motors[300];
        if (motors_words(motors, sizeof motors, &f)) cli_warn("%s", motors);
    } else printf("controller  not asked: %s\n", e.text);
    print_travel(&s, &f, path);
    char words[256];
    if (chain_check(words, &s, &e) != 0) cli_fail(CLI_FAILED, "%s: %s", path, e.text);
    printf("chain       %s\n", words);
    session_free(&s);
    return CLI_OK;
}

/* One value, as a script wants it. */
int show_get(const char *path, const char *what)
{
    session s;
    char value[FILLED_ROOM], text[FILLED_ROOM];
    errmsg e;
    load_session(&s, path);
    for (const session_key *k = session_keys; k->name; k++) {
        size_t n = strlen(k->section);
        if (strncmp(what, k->section, n) != 0 || what[n] != '.' || strcmp(what + n + 1, k->name) != 0)
            continue;
        session_value(text, sizeof text, &s, k);
        int bad = 0;
        if (!strcmp(what, "chain.fishremap")) bad = session_fishremap(value, &s, &e);
        else if (!strcmp(k->section, "chain")) bad = session_fill(value, &s, text, &e);
        if (bad) cli_fail(CLI_FAILED, "%s: %s", path, e.text);
        printf("%s\n", !strcmp(k->section, "chain") ? value : text);
        session_free(&s);
        return CLI_OK;
    }
    cli_fail(CLI_USAGE, "get: expected SECTION.KEY, found '%s'", what);
}

/* The list of times of each place, i fastest (or as listed): what stands beside it is made from it (scenes/capture.mk). */
int show_list(const char *path)
{
    session s;
    char times[NAME_ROOM], picture[NAME_ROOM];
    errmsg e;
    load_session(&s, path);
    for (long k = 0; k < plan_places(&s); k++) {
        const int i = s.listed ? s.listed[k][0] : (int)(k % s.nodes[0]),
                  j = s.listed ? s.listed[k][1] : (int)(k / s.nodes[0]);
        if (name_times(times, &s, i, j, &e) != 0 || name_picture(picture, &s, i, j, 0, &e) != 0)
            cli_fail(CLI_FAILED, "%s: %s", path, e.text);
        const char *a = strrchr(times, '/'), *b = strrchr(picture, '/');
        if (!a || !b || a - times != b - picture || strncmp(times, picture, (size_t)(a - times)) != 0)
            cli_fail(CLI_FAILED,
                     "%s: expected [output] times in the folder of its place's pictures, found '%s' and '%s'",
                     path, times, picture);
        printf("%s/%s\n", s.folder, times);
    }
    session_free(&s);
    return CLI_OK;
}

/* For make: the output changes when the room does. */
int show_seen(const char *path)
{
    session s;
    depends d;
    errmsg e;
    load_session(&s, path);
    if (depends_find(&d, &s, 0, &e) != 0) cli_fail(CLI_FAILED, "%s: %s", path, e.text);
    for (int k = 0; k < d.n; k++)
        printf("%s %s\n", d.file[k].digest[0] ? d.file[k].digest : "missing", d.file[k].name);
    depends_free(&d);
    session_free(&s);
    return CLI_OK;
}

int show_keys(void)
{
    const char *section = "";
    for (const session_key *k = session_keys; k->name; k++) {
        if (strcmp(section, k->section) != 0) printf("%s[%s]\n", *section ? "\n" : "", k->section);
        section = k->section;
        printf("# %s%s\n%s = %s\n", k->help, k->preset ? "" : " (must be given)", k->name,
               k->preset ? k->preset : "");
    }
    return CLI_OK;
}
