/* capture.c - the loop over places; see capture.h. */
#include "capture.h"
#include "capture_stage.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/outfile.h"
#include "cameracheck.h"
#include "deadline.h"
#include "files.h"
#include "leftover.h"
#include "names.h"
#include "positions.h"
#include "signals.h"
#include "trying.h"

enum { CHAIN_S = 1800 };

void capture_show(capture_run *r, const char *doing)
{
    long left = r->now.places - r->now.places_done;
    r->now.doing = doing;
    if (r->places_this_run > 0)
        r->now.left_s = (now_s() - r->started_s) / (double)r->places_this_run * (double)left;
    if (r->progress) r->progress(&r->now);
}

/* What the journal knows of a place's series, as the choice of the next exposure wants it. */
static void seen_of(exposure_seen *seen, const session *s, const journal_place *p)
{
    for (int k = 0; k < s->exposures; k++) {
        const journal_shot *t = p->shot ? &p->shot[k] : NULL;
        seen[k].taken = t && t->taken;
        seen[k].clips = seen[k].taken && t->clip > s->clip_share;
        seen[k].black = seen[k].taken && t->black > s->black_share;
    }
}

static int next_exposure(const capture_run *r, const journal_place *p)
{
    exposure_seen seen[EXPOSURES_MAX];
    seen_of(seen, r->s, p);
    if (r->s->adaptive) return exposures_next(seen, r->s->exposures, r->guess);
    for (int k = 0; k < r->s->exposures; k++)
        if (!seen[k].taken) return k;
    return -1;
}

/* The list of times that hdrgen reads; its presence tells make that the place is done.  Written if the place
 * is only now done, or the file is not there. */
static int write_times(const capture_run *r, const place *p, errmsg *e)
{
    const session *s = r->s;
    const journal_place *jp = journal_at(r->j, p->i, p->j);
    char name[NAME_ROOM], path[4096];
    outfile *o;
    if (name_times(name, s, p->i, p->j, e) != 0) return -1;
    if (!name[0]) return 0;
    if (files_join(path, sizeof path, s->folder, name, e) != 0) return -1;
    if (jp->done && access(path, F_OK) == 0) return 0;
    if (files_make_parents(path, e) != 0 || out_begin(&o, path, e) != 0) return -1;
    fprintf(out_stream(o), "# node %d %d, image seconds\n", p->i, p->j);
    for (int k = 0; k < s->exposures; k++) {
        if (!jp->shot || !jp->shot[k].taken) continue;
        if (name_picture(name, s, p->i, p->j, k, e) != 0) {
            out_abort(o);
            return -1;
        }
        const char *slash = strrchr(name, '/'), *base = slash ? slash + 1 : name;
        fprintf(out_stream(o), strpbrk(base, " \t") ? "\"%s\" %.10g\n" : "%s %.10g\n", base,
                s->list_times == TIMES_EXIF && jp->shot[k].seconds > 0 ? jp->shot[k].seconds
                                                                       : s->exposure[k]);
    }
    return out_commit(o, e);
}

int times_remove(const session *s, errmsg *e)
{
    char name[NAME_ROOM], path[4096];
    for (int j = 0; j < s->nodes[1]; j++)
        for (int i = 0; i < s->nodes[0]; i++) {
            if (name_times(name, s, i, j, e) != 0) return -1;
            if (!name[0]) return 0;
            if (files_join(path, sizeof path, s->folder, name, e) != 0) return -1;
            if (remove(path) != 0 && errno != ENOENT && errno != ENOTDIR) return err_errno(e, "%s", path);
        }
    return 0;
}

static stage_code finish_place(capture_run *r, const place *p, errmsg *e)
{
    const journal_place *jp = journal_at(r->j, p->i, p->j);
    exposure_seen seen[EXPOSURES_MAX];
    if (shots_commit(r, e) != 0) return STAGE_FAILED;
    if (write_times(r, p, e) != 0) return STAGE_FAILED;
    if (!jp->done && journal_done(r->j, p->i, p->j, e) != 0) return STAGE_FAILED;
    seen_of(seen, r->s, jp);
    if (r->s->adaptive) r->guess = exposures_guess(seen, r->s->exposures, r->guess);
    for (int k = 0; k < r->s->exposures; k++) r->shots_left_out += !seen[k].taken;
    r->now.places_done++;
    return STAGE_OK;
}

/* A camera that a killed run has left behind may still expose: nothing moves before it ends. */
static stage_code wait_for_camera(capture_run *r, errmsg *e)
{
    double until = now_s() + r->s->timeout + r->s->exposure[r->s->exposures - 1];
    if (positions_adaptive(r->s)) until += CHAIN_S; /* it may be a step of the chain (rounds.h) */
    char name[64];
    errmsg words;
    int told = 0;
    for (long pid; (pid = leftover_find(r->camera_fd, name, sizeof name)) != 0;) {
        err_set(&words,
                "a camera command of an earlier run is still at work (process %ld, %s); waiting for it", pid,
                name);
        if (!told++ && r->say) r->say(words.text);
        if (now_s() > until) {
            err_set(
                e,
                "%s: a camera command of an earlier run does not end: process %ld, %s; end it (kill %ld) and "
                "start again",
                r->s->folder, pid, name, pid);
            return STAGE_FAILED;
        }
        if (signals_pause(0.05) != 0) {
            err_set(e, "interrupted while waiting for a camera");
            return STAGE_INTERRUPTED;
        }
    }
    return STAGE_OK;
}

static stage_code open_files(capture_run *r, errmsg *e)
{
    char path[4096];
    if (files_join(path, sizeof path, r->s->folder, ".camera", e) != 0) return STAGE_FAILED;
    r->camera_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (r->camera_fd >= 0 && files_join(path, sizeof path, r->s->folder, "camera.log", e) != 0)
        return STAGE_FAILED;
    if (r->camera_fd >= 0) r->log_fd = open(path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (r->camera_fd < 0 || r->log_fd < 0) {
        err_errno(e, "%s", path);
        return STAGE_FAILED;
    }
    return STAGE_OK;
}

static stage_code take_place(capture_run *r, const place *p, const double *from, errmsg *e)
{
    const session *s = r->s;
    stage *st = r->stage;
    double path[2][2], arrived[2];
    char state[32];
    journal_place *jp = journal_at(r->j, p->i, p->j);
    capture_show(r, "moving");
    if (!jp->begun && journal_begin(r->j, p->i, p->j, e) != 0) return STAGE_FAILED;
    stage_code c = st->driver->check(st, e);
    int n = plan_path(path, s, from, p->machine);
    if (c == STAGE_OK) c = st->driver->go(st, (const double(*)[2])path, n, s->feed, s->settle, e);
    if (c == STAGE_OK) c = st->driver->where(st, arrived, state, e);
    if (c != STAGE_OK) return c;
    if (journal_arrived(r->j, p->i, p->j, arrived, e) != 0) return STAGE_FAILED;
    for (int k; (k = next_exposure(r, jp)) >= 0;) {
        r->now.k = k;
        capture_show(r, "exposing");
        if ((c = shot_take(r, p, arrived, k, e)) != STAGE_OK) return c;
        r->now.shots++;
        r->shots_taken++;
    }
    return STAGE_OK;
}

/* *from: where it comes from; NULL = unknown side, after homing or a resume. */
static stage_code visit(capture_run *r, const place *p, int needed, double at[2], const double **from,
                        errmsg *e)
{
    stage_code c = STAGE_OK;
    if (signals_number()) {
        err_set(e, "interrupted");
        return STAGE_INTERRUPTED;
    }
    if (needed && !r->stage->port) {
        c = capture_ready_stage(r, e);
        if (c == STAGE_OK) c = camera_check(r, p, 1, 0, at, from, e);
        r->started_s = now_s();
    }
    if (needed && c == STAGE_OK) {
        c = take_place(r, p, *from, e);
        memcpy(at, p->machine, 2 * sizeof *at);
        *from = at;
        r->places_this_run++;
        if (r->unchecked++ == 0) r->doubt_from = p->index;
    }
    if (c == STAGE_OK) c = finish_place(r, p, e);
    if (c == STAGE_OK && needed) capture_show(r, "done");
    if (c == STAGE_OK && r->s->check_home > 0 && r->unchecked >= r->s->check_home) {
        c = capture_check_home(r, p->index, e);
        *from = NULL;
    }
    if (c == STAGE_OK && needed) c = camera_check(r, p, 0, 0, at, from, e);
    return c;
}

/* What on_fail = skip leaves for later, when the camera's retries are used up: 1. */
static int left_for_later(capture_run *r, stage_code *c, errmsg *e)
{
    errmsg words;
    if (*c != STAGE_FAILED || !r->camera_failed || r->s->on_fail != FAIL_SKIP) return 0;
    r->camera_failed = 0;
    err_set(&words, "%s; left for the end", e->text);
    if (r->say) r->say(words.text);
    *c = shots_commit(r, e) == 0 ? STAGE_OK : STAGE_FAILED;
    return 1;
}

/* Once over all places; left gets how many of them the camera has failed at, e the words of the last. */
static stage_code once_over(capture_run *r, int only_missing, long *left, errmsg *e)
{
    const session *s = r->s;
    double at[2];
    const double *from = NULL;
    *left = 0;
    for (long index = 0; index < plan_places(s); index++) {
        place p;
        plan_place(&p, s, index);
        const journal_place *jp = journal_at(r->j, p.i, p.j);
        if (only_missing && jp->done) continue;
        r->now.i = p.i;
        r->now.j = p.j;
        stage_code c = visit(r, &p, !jp->done && next_exposure(r, jp) >= 0, at, &from, e);
        *left += left_for_later(r, &c, e);
        if (c != STAGE_OK) return c;
    }
    if (s->check_home > 0 && r->unchecked > 0) {
        stage_code c = capture_check_home(r, plan_places(s) - 1, e);
        if (c != STAGE_OK) return c;
        from = NULL;
    }
    return camera_check(r, NULL, 0, 1, at, &from, e);
}

static stage_code all_places(capture_run *r, errmsg *e)
{
    long left;
    errmsg why;
    r->now.places_done = r->shots_left_out = 0;
    stage_code c = once_over(r, 0, &left, e);
    if (c == STAGE_OK && left > 0) c = once_over(r, 1, &left, e);
    if (c != STAGE_OK || left == 0) return c;
    why = *e;
    err_set(e, "%ld place%s still without all exposures; the last: %s", left, left == 1 ? " is" : "s are",
            why.text);
    r->camera_failed = 1;
    return STAGE_FAILED;
}

/* What the session's first picture said of f-number and ISO, as far as it is on record. */
static void first_of(capture_run *r)
{
    for (long index = 0; index < plan_places(r->s) && !(r->first[0] > 0 && r->first[1] > 0); index++) {
        place p;
        plan_place(&p, r->s, index);
        const journal_shot *t = journal_at(r->j, p.i, p.j)->shot;
        for (int k = 0; t && k < r->s->exposures; k++) {
            if (!t[k].taken) continue;
            if (!(r->first[0] > 0)) r->first[0] = t[k].f_number;
            if (!(r->first[1] > 0)) r->first[1] = t[k].iso;
        }
    }
}

/* Again and again, with --keep-trying.  When it was the camera the stage stays as it is, idle. */
static stage_code try_all_places(capture_run *r, errmsg *e)
{
    for (;;) {
        stage_code c = all_places(r, e);
        if (c == STAGE_OK || !r->keep_trying) return c;
        if (c != STAGE_INTERRUPTED && !(c == STAGE_FAILED && r->camera_failed)) {
            capture_leave_stage(r, c);
            stage_close(r->stage);
        }
        if (!trying_again(r, &c, e)) return c;
        r->camera_failed = 0;
        if (shots_commit(r, e) != 0 || journal_run(r->j, e) != 0) return STAGE_FAILED;
    }
}

stage_code capture_all(capture_run *r, errmsg *e)
{
    r->log_fd = r->camera_fd = -1;
    r->now.places = plan_places(r->s);
    r->now.shots_most = r->now.places * r->s->exposures;
    r->guess = (r->s->exposures - 1) / 2;
    stage_code c = STAGE_FAILED;
    if (reconcile(r->j, r->s, 0, 1, r->say, e) >= 0 && journal_run(r->j, e) == 0) {
        r->now.shots = journal_shots(r->j);
        first_of(r);
        c = open_files(r, e);
        if (c == STAGE_OK) c = wait_for_camera(r, e);
        if (c == STAGE_OK) c = try_all_places(r, e);
    }
    if (c != STAGE_OK) capture_leave_stage(r, c);
    errmsg why;
    if (shots_commit(r, &why) != 0 && c == STAGE_OK) {
        *e = why;
        c = STAGE_FAILED;
    }
    stage_close(r->stage);
    if (r->log_fd >= 0) close(r->log_fd);
    if (r->camera_fd >= 0) close(r->camera_fd);
    return c;
}
