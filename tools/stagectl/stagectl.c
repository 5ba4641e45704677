/*
 * stagectl.c - moves the camera over the grid and takes the exposures.
 *
 * Exit codes: 0 done, 1 input or I/O, 2 usage, 3 stage silent or unplugged, 4 stage refused, 128 + signal
 * after the stage was told to hold.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/cli.h"
#include "capture.h"
#include "files.h"
#include "names.h"
#include "positions.h"
#include "rounds.h"
#include "signals.h"
#include "stagectl_show.h"

static struct {
    const char *port, *driver, *homing, *dtr;
    int baud;
    double feed, settle, home_timeout;
    double steps_per_mm[2], from[2];
    int dry_run, assume_position, have_from, anew, keep_trying;
} o = {.feed = 1500, .settle = 0.1, .homing = "$H"};

static int take_pair(const char *value, void *arg, errmsg *e)
{
    if (arg == o.from) o.have_from = 1;
    return cli_parse_doubles(arg, 2, value, ",", e);
}

static const cli_opt opts[] = {
    {"port", 0, CLI_STRING, &o.port, NULL, "DEV",
     "serial port of the stage, or tcp:HOST:PORT; wins over the session's"},
    {"driver", 0, CLI_STRING, &o.driver, NULL, "NAME",
     "grbl (default): GRBL 1.1 and grblHAL; c4: Arrick MD-2 through its C4\n"
     "controller, inferred and unverified on hardware.  Sessions name their own"},
    {"feed", 0, CLI_DOUBLE, &o.feed, NULL, "F", "move: speed, mm/min (1500)"},
    {"settle", 0, CLI_DOUBLE, &o.settle, NULL, "S", "move: rest at the end, s (0.1)"},
    {"home-timeout", 0, CLI_DOUBLE, &o.home_timeout, NULL, "S",
     "home: longest time, s (0: what the controller's settings say)"},
    {"homing", 0, CLI_STRING, &o.homing, NULL, "WORDS",
     "home: the commands, for firmware that homes single axes: '$HX $HY' ($H)"},
    {"baud", 0, CLI_INT, &o.baud, NULL, "N", "speed of the serial line (115200; c4 9600)"},
    {"dtr", 0, CLI_STRING, &o.dtr, NULL, "off", "drop DTR and RTS once the port is open (on)"},
    {"steps-per-mm", 0, CLI_CALL, o.steps_per_mm, take_pair, "X,Y", "c4: steps per mm (7.874016 direct)"},
    {"from", 0, CLI_CALL, o.from, take_pair, "X,Y", "move: the stage stands there (for c4, which can't say)"},
    {"assume-position", 0, CLI_FLAG, &o.assume_position, NULL, NULL,
     "capture: don't home, the stage has kept its position"},
    {"anew", 0, CLI_FLAG, &o.anew, NULL, NULL,
     "capture: take all exposures again, over those that are there: the room, or the plan, is another"},
    {"keep-trying", 0, CLI_FLAG, &o.keep_trying, NULL, NULL,
     "capture: after a failure of camera or stage (unplugged, say) go on by itself"},
    {"dry-run", 0, CLI_FLAG, &o.dry_run, NULL, NULL, "say what would be done; touch neither stage nor files"},
    {0}};

static const cli_choice choices[] = {
    {"", "home move where status unlock plan capture resume verify keys get list seen"},
    {"driver", "grbl c4"},
    {"dtr", "on off"},
    {0},
};

static const cli_prog prog = {
    .name = "stagectl",
    .operands = "COMMAND [ARGUMENT]...",
    .summary = "Move a camera over a grid and take its exposures, whatever happens.",
    .opts = opts,
    .choices = choices,
    .epilog = "Commands:\n"
              "  home, move X Y        the stage; positions are machine mm\n"
              "  where, status         where it stands; what it is\n"
              "  unlock                out of an alarm without homing: it stands where it says\n"
              "  plan SESSION          moves, times, space, travel; asks the controller if it is there\n"
              "  capture SESSION       take what is not taken yet (resume SESSION: the same)\n"
              "  verify SESSION        compare all files with the journal\n"
              "  keys                  what may stand in a session file, with defaults\n"
              "  get SESSION S.KEY     one value of it; list SESSION: lists of times, i fastest\n"
              "  seen SESSION          digests of the files that the camera's view depends on\n\n"
              "Exit codes: 0 done, 1 failed, 2 usage, 3 stage silent or unplugged, 4 stage\n"
              "refused, 130 interrupted after the stage was told to hold."};

static void note(const char *words)
{
    cli_note("%s", words);
}

static void warn(const char *words)
{
    cli_warn("%s", words);
}

static int exit_code(stage_code c)
{
    if (c == STAGE_INTERRUPTED) return 128 + signals_first();
    return c == STAGE_GONE ? STAGE_SILENT : (int)c;
}

/* ---- single commands to the stage ------------------------------------------------------------- */

static _Noreturn void end_stage(stage *s, stage_code c, const errmsg *e)
{
    errmsg why;
    if (c == STAGE_INTERRUPTED) signals_acknowledge();
    /* whatever ended it, it does not go on moving */
    if (s->port && c != STAGE_GONE && (s->under_way || c == STAGE_INTERRUPTED) &&
        s->driver->halt(s, &why) != STAGE_OK)
        cli_warn("%s", why.text);
    stage_close(s);
    cli_fail(exit_code(c), "%s", e->text);
}

static const char *driver_name(void)
{
    return o.driver ? o.driver : "grbl";
}

static void open_stage(stage *s)
{
    errmsg e;
    const stage_driver *d = stage_driver_by_name(driver_name());
    if (!d) cli_fail(CLI_USAGE, "--driver: expected grbl or c4, found '%s'", o.driver);
    if (!o.port) cli_fail(CLI_USAGE, "expected --port DEV: ports that you don't name are not touched");
    s->home_timeout_s = o.home_timeout;
    s->homing = o.homing;
    if (stage_homing_check(o.homing, &e) != 0) cli_fail(CLI_USAGE, "--%s", e.text);
    if (o.dtr && strcmp(o.dtr, "on") != 0 && strcmp(o.dtr, "off") != 0)
        cli_fail(CLI_USAGE, "--dtr: expected on or off, found '%s'", o.dtr);
    if (o.baud < 0) cli_fail(CLI_USAGE, "--baud: expected a speed above 0, found %d", o.baud);
    s->dtr_off = o.dtr && !strcmp(o.dtr, "off");
    s->baud = o.baud;
    memcpy(s->stated_steps_per_mm, o.steps_per_mm, sizeof s->stated_steps_per_mm);
    stage_code c = stage_open(s, d, o.port, &e);
    if (c != STAGE_OK) end_stage(s, c, &e);
    if (o.have_from) d->assume(s, o.from);
}

static int do_home(void)
{
    errmsg e;
    double xy[2];
    char state[32];
    stage s = {.note = note};
    if (o.dry_run) {
        printf("would home the stage on %s (%s)\n", o.port ? o.port : "the port", driver_name());
        return CLI_OK;
    }
    open_stage(&s);
    stage_code c = s.driver->home(&s, &e);
    if (c == STAGE_OK) c = s.driver->where(&s, xy, state, &e);
    if (c != STAGE_OK) end_stage(&s, c, &e);
    printf("%.3f %.3f\n", xy[0], xy[1]);
    stage_close(&s);
    return CLI_OK;
}

static int do_move(const char *x, const char *y)
{
    errmsg e;
    double to[2], xy[2];
    char state[32];
    stage s = {.note = note};
    if (cli_parse_double(&to[0], x, &e) != 0 || cli_parse_double(&to[1], y, &e) != 0)
        cli_fail(CLI_USAGE, "move: %s", e.text);
    if (!(o.feed > 0)) cli_fail(CLI_USAGE, "--feed: expected a speed above 0, found %g", o.feed);
    if (!(o.settle >= 0)) cli_fail(CLI_USAGE, "--settle: expected 0 s or more, found %g", o.settle);
    if (o.dry_run) {
        printf("would move to %.3f %.3f mm at %g mm/min\n", to[0], to[1], o.feed);
        return CLI_OK;
    }
    open_stage(&s);
    for (int a = 0; a < 2; a++)
        if (s.facts.has_travel && !(to[a] >= s.facts.lo[a] && to[a] <= s.facts.hi[a])) {
            err_set(&e, "move: expected %c from %g to %g mm%s, found %g", "xy"[a], s.facts.lo[a],
                    s.facts.hi[a], s.facts.margin_mm > 0 ? " (the switch is an alarm: $21, $27)" : "", to[a]);
            end_stage(&s, STAGE_FAILED, &e);
        }
    if (!s.position_known) {
        err_set(&e,
                s.locked
                    ? s.facts.can_home
                          ? "stage: in alarm: home it first, or 'stagectl unlock' if it stands where it says"
                          : "stage: in alarm, and homing is switched off ($22=0): 'stagectl unlock' is the "
                            "way out"
                    : "stage: its position is not known, home it first");
        end_stage(&s, STAGE_REFUSED, &e);
    }
    const double path[1][2] = {{to[0], to[1]}};
    stage_code c = s.driver->go(&s, path, 1, o.feed, o.settle, &e);
    if (c == STAGE_OK) c = s.driver->where(&s, xy, state, &e);
    if (c != STAGE_OK) end_stage(&s, c, &e);
    printf("%.3f %.3f\n", xy[0], xy[1]);
    stage_close(&s);
    return CLI_OK;
}

static int do_status(int where_only)
{
    errmsg e;
    char words[256];
    double xy[2];
    char state[32];
    stage s = {.note = note};
    open_stage(&s);
    stage_code c = s.driver->where(&s, xy, state, &e);
    if (c != STAGE_OK) end_stage(&s, c, &e);
    if (where_only) {
        printf("%.3f %.3f\n", xy[0], xy[1]);
    } else {
        const stage_facts *f = &s.facts;
        printf("controller  %s\nstate       %s\nposition    %.3f %.3f mm%s\n", f->ident, state, xy[0], xy[1],
               s.position_known ? ""
               : !f->can_home   ? " (not to be trusted: unlock it when it stands there)"
                                : " (not to be trusted: home it)");
        printf("steps/mm    %g %g\nhoming      %s\n", f->steps_per_mm[0], f->steps_per_mm[1],
               f->can_home ? "yes" : "no");
        if (f->has_travel)
            printf("travel      x %g to %g, y %g to %g mm%s\n", f->lo[0], f->hi[0], f->lo[1], f->hi[1],
                   f->margin_mm > 0 ? " (without $27 at the switches: $21=1)" : "");
        if (f->motors_rest_ms >= 0)
            printf("motors      %s\n",
                   f->motors_rest_ms == 255 ? "stay on" : "without current while the stage stands");
        if (motors_words(words, sizeof words, f)) cli_warn("%s", words);
    }
    stage_close(&s);
    return CLI_OK;
}

/* Out of an alarm on the user's word. */
static int do_unlock(void)
{
    errmsg e;
    double xy[2];
    char state[32];
    stage s = {.note = note};
    if (o.dry_run) {
        printf("would unlock the stage on %s\n", o.port ? o.port : "the port");
        return CLI_OK;
    }
    open_stage(&s);
    if (!s.driver->unlock) {
        err_set(&e, "unlock: the %s driver knows no alarms", s.driver->name);
        end_stage(&s, STAGE_FAILED, &e);
    }
    int was = s.locked;
    stage_code c = s.driver->unlock(&s, &e);
    if (c == STAGE_OK) c = s.driver->where(&s, xy, state, &e);
    if (c != STAGE_OK) end_stage(&s, c, &e);
    if (was) cli_warn("its position is taken on your word: an alarm in motion loses steps");
    else cli_note("it was not locked");
    printf("%.3f %.3f\n", xy[0], xy[1]);
    stage_close(&s);
    return CLI_OK;
}

/* ---- sessions ---------------------------------------------------------------------------------- */

static capture_progress latest;

static void print_progress(const capture_progress *p, const char *end)
{
    fprintf(stderr, "%s: place %ld/%ld (%d,%d) %s, %ld/%ld exposures", prog.name,
            p->places_done + (p->places_done < p->places), p->places, p->i, p->j,
            p->doing ? p->doing : "starting", p->shots, p->shots_most);
    if (p->left_s > 0)
        fprintf(stderr, ", %d h %02d min left", (int)(p->left_s / 3600), (int)(fmod(p->left_s, 3600) / 60));
    fputs(end, stderr);
}

static void status_line(void)
{
    if (latest.places > 0) print_progress(&latest, "\n");
}

static void progress(const capture_progress *p)
{
    static int terminal = -1;
    latest = *p;
    if (terminal < 0) terminal = isatty(STDERR_FILENO);
    if (!terminal || cli_quiet) return;
    fputs("\r", stderr);
    print_progress(p, "\033[K"); /* clear what a longer line left */
}

static void dry_capture(const session *s)
{
    char name[NAME_ROOM];
    errmsg e;
    for (long k = 0; k < plan_places(s); k++) {
        place p;
        plan_place(&p, s, k);
        printf("node %d,%d at %.3f %.3f mm:", p.i, p.j, p.machine[0], p.machine[1]);
        for (int q = 0; q < s->exposures; q++) {
            argwords argv;
            if (name_picture(name, s, p.i, p.j, q, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
            if (name_command(&argv, s, &p, p.machine, q, name, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
            if (k == 0 && q == 0) {
                fputs("\n  first command:", stdout);
                for (int w = 0; w < argv.n; w++) printf(" %s", argv.word[w]);
                fputs("\n ", stdout);
            }
            argwords_free(&argv);
            printf(" %s", name);
        }
        printf("\n");
    }
}

/* Once over the places; adaptive sessions again and again, as long as the chain asks for more. */
static stage_code all_rounds(capture_run *r, session *s, const char *path, errmsg *e)
{
    const capture_run fresh = *r;
    for (;;) {
        const long taken = r->shots_taken;
        const int known = r->was_known;
        long more;
        *r = fresh;
        r->was_known = known, r->shots_taken = taken;
        stage_code c = capture_all(r, e);
        if (c != STAGE_OK || !positions_adaptive(s)) return c;
        if ((c = rounds_next(&more, s, path, note, e)) != STAGE_OK || more == 0) return c;
        latest.places = plan_places(s);
    }
}

static int do_capture(const char *path)
{
    session s;
    journal *j;
    errmsg e;
    load_session(&s, path);
    if (o.dry_run) {
        dry_capture(&s);
        session_free(&s);
        return CLI_OK;
    }
    stage st = {.note = note};
    capture_run r = {.s = &s,
                     .stage = &st,
                     .port = o.port ? o.port : s.port,
                     .assume_position = o.assume_position,
                     .keep_trying = o.keep_trying,
                     .baud = o.baud,
                     .dtr_off = o.dtr && !strcmp(o.dtr, "off"),
                     .say = warn,
                     .progress = progress};
    if (o.driver && strcmp(o.driver, s.driver) != 0)
        cli_fail(CLI_USAGE, "--driver: expected %s as in %s, found '%s'", s.driver, path, o.driver);
    if (!r.port[0]) cli_fail(CLI_USAGE, "expected --port DEV, or port in [stage] of %s", path);
    char inside[4096];
    if (files_join(inside, sizeof inside, s.folder, "journal", &e) != 0 ||
        files_make_parents(inside, &e) != 0)
        cli_fail(CLI_FAILED, "%s", e.text);
    depends seen, after;
    if (depends_find(&seen, &s, 1, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
    if (journal_open(&j, &s, o.anew ? JOURNAL_ANEW : JOURNAL_GO_ON, &e) != 0)
        cli_fail(CLI_FAILED, "%s", e.text);
    if (o.anew && (times_remove(&s, &e) != 0 || positions_anew(&s, &e) != 0 || journal_anew(j, &e) != 0))
        cli_fail(CLI_FAILED, "%s", e.text);
    if (journal_dropped(j)) cli_note("%s/journal: dropped a torn last line", s.folder);
    int adopted = journal_seen(j, &seen, &e);
    if (adopted < 0) cli_fail(CLI_FAILED, "%s", e.text);
    if (adopted)
        cli_warn("%s/journal: what the camera saw is not on record for the exposures on disk; taken to be "
                 "what it sees now",
                 s.folder);
    const plan_limits none = {{0}, {0}};
    plan_totals t;
    plan_sum(&t, &s, &none);
    double room = free_bytes(s.folder), more = (double)(t.exposures - journal_shots(j)) * s.file_mb * 1e6;
    if (room >= 0 && room < more)
        cli_warn("%s: %.1f MB free, the rest may need %.1f MB", s.folder, room / 1e6, more / 1e6);
    r.j = j;
    latest.places = t.places;
    if (positions_begin(&s, &e) != 0) cli_fail(CLI_FAILED, "%s", e.text);
    stage_code c = all_rounds(&r, &s, path, &e);
    if (c == STAGE_OK && r.shots_taken > 0) { /* nobody may have edited the room meanwhile */
        if (depends_find(&after, &s, 1, &e) != 0 || journal_seen(j, &after, &e) < 0) c = STAGE_FAILED;
        depends_free(&after);
    }
    depends_free(&seen);
    if (isatty(STDERR_FILENO) && !cli_quiet) fputs("\n", stderr);
    if (c == STAGE_OK)
        cli_note(s.adaptive ? "%ld places, %ld exposures on disk (%ld taken now, %ld left out as not needed)"
                            : "%ld places, %ld exposures on disk (%ld taken now)",
                 r.now.places_done, journal_shots(j), r.shots_taken, r.shots_left_out);
    if (r.in_doubt)
        cli_warn("%ld places are in doubt: check_home has found lost steps (see above)", r.in_doubt);
    journal_close(j);
    if (c != STAGE_OK) cli_fail(exit_code(c), "%s", e.text);
    session_free(&s);
    return CLI_OK;
}

static int do_verify(const char *path)
{
    session s;
    journal *j;
    errmsg e;
    load_session(&s, path);
    depends seen;
    if (journal_open(&j, &s, JOURNAL_READ, &e) != 0 || depends_find(&seen, &s, 0, &e) != 0 ||
        journal_seen(j, &seen, &e) < 0)
        cli_fail(CLI_FAILED, "%s", e.text);
    depends_free(&seen);
    long amiss = reconcile(j, &s, 1, 0, warn, &e), done = 0, shots = journal_shots(j);
    if (amiss < 0) cli_fail(CLI_FAILED, "%s", e.text);
    for (long k = 0; k < plan_places(&s); k++) {
        place p;
        plan_place(&p, &s, k);
        done += journal_at(j, p.i, p.j)->done;
    }
    printf("%ld of %ld places finished, %ld exposures on record, %ld missing or changed\n", done,
           plan_places(&s), shots, amiss);
    journal_close(j);
    int whole = amiss == 0 && done == plan_places(&s);
    session_free(&s);
    return whole ? CLI_OK : CLI_FAILED;
}

int main(int argc, char **argv)
{
    int n = cli_parse(&prog, argc, argv);
    const char *what = n > 0 ? argv[1] : "";
    signals_install(status_line);
    int code = -1;
    if (!strcmp(what, "home") && n == 1) code = do_home();
    else if (!strcmp(what, "move") && n == 3) code = do_move(argv[2], argv[3]);
    else if (!strcmp(what, "where") && n == 1) code = do_status(1);
    else if (!strcmp(what, "status") && n == 1) code = do_status(0);
    else if (!strcmp(what, "unlock") && n == 1) code = do_unlock();
    else if (!strcmp(what, "plan") && n == 2) code = show_plan(argv[2], o.port);
    else if ((!strcmp(what, "capture") || !strcmp(what, "resume")) && n == 2) code = do_capture(argv[2]);
    else if (!strcmp(what, "verify") && n == 2) code = do_verify(argv[2]);
    else if (!strcmp(what, "get") && n == 3) code = show_get(argv[2], argv[3]);
    else if (!strcmp(what, "list") && n == 2) code = show_list(argv[2]);
    else if (!strcmp(what, "seen") && n == 2) code = show_seen(argv[2]);
    else if (!strcmp(what, "keys") && n == 1) code = show_keys();
    if (code < 0 && n == 0)
        cli_fail(CLI_USAGE,
                 "expected a command: home, move, where, status, unlock, plan, capture, verify, keys");
    if (code < 0)
        cli_fail(CLI_USAGE, "expected a command with its arguments, found '%s' with %d", what, n - 1);
    return cli_end(code);
}
