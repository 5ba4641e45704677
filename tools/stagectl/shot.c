/* shot.c - one exposure, from the camera's command to a file that the journal vouches for. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "asked.h"
#include "camera.h"
#include "camerawords.h"
#include "capture.h"
#include "deadline.h"
#include "files.h"
#include "names.h"
#include "picture_in.h"
#include "sha256.h"
#include "siblings.h"
#include "signals.h"

enum { TOLD_ENDING = 1, TOLD_NO_TIME = 2 };

/* What the picture says of itself against what was asked.  Files that came with it may say what it doesn't.
 */
static int look_at_facts(capture_run *r, journal_shot *t, const place *p, int k, const char *path, errmsg *e)
{
    const session *s = r->s;
    char temp[4096], final[4096];
    picture_says says;
    asked_read(&says, path);
    snprintf(t->format, sizeof t->format, "%s", says.format);
    for (int b = 0; b < t->n_beside && !(says.seconds > 0); b++) {
        if (siblings_paths(temp, final, s, p->i, p->j, k, t, &t->beside[b], e) != 0) return -1;
        asked_read(&says, temp);
    }
    if (asked_compare(&says, s, k, r->first, e) != 0) return -1;
    t->seconds = says.seconds;
    t->f_number = says.f_number;
    t->iso = says.iso;
    return 0;
}

/* Said once in a run, about pictures that are kept. */
static void tell_facts(capture_run *r, const journal_shot *t, const place *p, int k, const char *name)
{
    const session *s = r->s;
    const picture_says says = {.seconds = t->seconds};
    const char *promised = ending_format(name);
    errmsg words;
    if (!r->say) return;
    if (!ending_agrees(name, t->format) && !(r->told & TOLD_ENDING)) {
        r->told |= TOLD_ENDING;
        err_set(&words, "%s: its name says %s, it holds %s ([output] file)", name, promised, t->format);
        r->say(words.text);
    }
    int could = !strcmp(t->format, "jpeg") || !strcmp(t->format, "tiff") || !strcmp(t->format, "raw");
    if (could && !(t->seconds > 0) && !(r->told & TOLD_NO_TIME)) {
        r->told |= TOLD_NO_TIME;
        err_set(&words, "%s: doesn't say its exposure time: taken to be %.6g s as asked (and so on)", name,
                s->exposure[k]);
        r->say(words.text);
    }
    if (asked_differs(&says, s, k) && !(r->told_time >> k & 1)) {
        r->told_time |= (uint64_t)1 << k;
        err_set(&words,
                "node %d,%d exposure %d: asked for %.6g s, the picture says %.6g s: so it stands in the list",
                p->i, p->j, k, s->exposure[k], t->seconds);
        r->say(words.text);
    }
}

/* Exit code 0 is not trusted: the file must be there, new (its name never was), not empty, whole, and taken
 * as was asked. */
static int look_at(capture_run *r, journal_shot *t, const place *p, int k, const char *path, errmsg *e)
{
    const session *s = r->s;
    struct stat st;
    if (siblings_picture(s, t->temp, e) != 0) return -1;
    if (lstat(path, &st) != 0 || !S_ISREG(st.st_mode))
        return err_set(e, "camera: exit code 0, but it wrote no file");
    if (st.st_size == 0) return err_set(e, "camera: exit code 0, but its file is empty");
    if (s->check == CHECK_DECODE && picture_whole(path, e) != 0) return -1;
    if (s->adaptive) {
        const picture_levels l = {s->clip_level, s->black_level, s->circle};
        if (picture_shares(&t->clip, &t->black, path, &l, e) != 0) return -1;
    }
    if (sha256_file(t->digest, &t->size, path, e) != 0) return -1;
    if (lstat(path, &st) != 0) return err_errno(e, "%s", path);
    t->mtime_ns = (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec;
    if (siblings_find(t, s, e) != 0) return -1;
    return look_at_facts(r, t, p, k, path, e);
}

int shots_commit(capture_run *r, errmsg *e)
{
    const session *s = r->s;
    const place *p = &r->pending_at;
    char name[NAME_ROOM], path[4096], temp[4096];
    if (r->n_pending == 0) return 0;
    if (journal_sync(r->j, e) != 0) return -1;
    while (r->n_pending > 0) {
        int k = r->pending[r->n_pending - 1];
        const char *from = journal_at(r->j, p->i, p->j)->shot[k].temp;
        if (name_picture(name, s, p->i, p->j, k, e) != 0 ||
            files_join(path, sizeof path, s->folder, name, e) != 0 ||
            files_join(temp, sizeof temp, s->folder, from, e) != 0)
            return -1;
        if (siblings_commit(s, p->i, p->j, k, &journal_at(r->j, p->i, p->j)->shot[k], e) != 0) return -1;
        if (rename(temp, path) != 0) return err_errno(e, "%s", path);
        r->n_pending--;
    }
    r->committed_s = now_s();
    return 0;
}

static stage_code expose(capture_run *r, journal_shot *t, const place *p, const double arrived[2], int k,
                         const char *path, errmsg *e)
{
    const session *s = r->s;
    argwords argv, words;
    char *expect = malloc(WORD_ROOM);
    if (!expect) {
        err_set(e, "out of memory");
        return STAGE_FAILED;
    }
    if (name_text(expect, s, s->expect_text, p, arrived, k, e) != 0 ||
        name_command(&argv, s, p, arrived, k, path, e) != 0) {
        free(expect);
        return STAGE_FAILED;
    }
    int gphoto2 = argwords_split(&words, s->command, NULL) == 0 && camera_runs(&words, "gphoto2");
    argwords_free(&words);
    const camera_limits l = {.timeout_s = s->exposure[k] + s->timeout,
                             .kill_after_s = s->kill_after,
                             .error_text = s->error_text,
                             .expect_text = expect,
                             .saves_one = gphoto2 && !strchr(s->command, '%'),
                             .log_fd = r->log_fd,
                             .note_fd = r->camera_fd};
    camera_result c = camera_run(&argv, &l, e);
    argwords_free(&argv);
    free(expect);
    if (c == CAMERA_INTERRUPTED) return STAGE_INTERRUPTED;
    if (c == CAMERA_FAILED) return STAGE_FAILED;
    return look_at(r, t, p, k, path, e) == 0 ? STAGE_OK : STAGE_FAILED;
}

/* A name that nobody can foresee: the camera's program will write to whatever stands there. */
static int temp_name(char out[40], const char *ending, errmsg *e)
{
    uint64_t number;
    ssize_t n;
    do n = getrandom(&number, sizeof number, 0);
    while (n < 0 && errno == EINTR);
    if (n != (ssize_t)sizeof number) return err_errno(e, "random numbers");
    snprintf(out, 40, ".shot-%016" PRIx64 "%s", number, ending);
    return 0;
}

/* Try until it is there: its files are on disk under temporary names, and t describes them. */
static stage_code try_for(capture_run *r, journal_shot *t, const place *p, const double arrived[2], int k,
                          const char *ending, errmsg *e)
{
    const session *s = r->s;
    char temp[4096];
    for (int attempt = 0;; attempt++) {
        *t = (journal_shot){0};
        if (temp_name(t->temp, ending, e) != 0 || files_join(temp, sizeof temp, s->folder, t->temp, e) != 0)
            return STAGE_FAILED;
        stage_code code = expose(r, t, p, arrived, k, temp, e);
        if (code == STAGE_OK) return code;
        siblings_remove(s, t->temp);
        free(t->beside);
        t->beside = NULL;
        if (code != STAGE_FAILED) return code;
        if (attempt >= s->retries) {
            r->camera_failed = 1;
            return code;
        }
        errmsg words;
        err_set(&words, "node %d,%d exposure %d: %s; trying again", p->i, p->j, k, e->text);
        if (r->say) r->say(words.text);
        if (signals_pause(s->retry_wait) != 0) {
            err_set(e, "interrupted while waiting for another try");
            return STAGE_INTERRUPTED;
        }
    }
}

/* What the journal knows may be replaced (it was found missing or changed), what it never saw may not. */
static stage_code record(capture_run *r, journal_shot *t, const place *p, int k, const char *name, errmsg *e)
{
    journal_shot *shots = journal_at(r->j, p->i, p->j)->shot,
                 *known = shots && shots[k].digest[0] ? &shots[k] : NULL;
    stage_code code;
    /* The stage may have said something meanwhile: what it says first was the picture taken under. */
    if ((code = r->stage->driver->check(r->stage, e)) != STAGE_OK ||
        (siblings_are_new(r->s, p->i, p->j, k, t, known, e) != 0 && (code = STAGE_FAILED)) ||
        (siblings_replace(r->s, p->i, p->j, k, t, known, r->say, e) != 0 && (code = STAGE_FAILED))) {
        siblings_remove(r->s, t->temp);
        free(t->beside);
        return code;
    }
    tell_facts(r, t, p, k, name);
    if (!(r->first[0] > 0)) r->first[0] = t->f_number;
    if (!(r->first[1] > 0)) r->first[1] = t->iso;
    if (journal_shot_taken(r->j, p->i, p->j, k, t, name, e) != 0) return STAGE_FAILED;
    r->pending_at = *p;
    r->pending[r->n_pending++] = k;
    return now_s() < r->committed_s + 1 || shots_commit(r, e) == 0 ? STAGE_OK : STAGE_FAILED;
}

stage_code shot_try(capture_run *r, const place *p, const double arrived[2], int k, char temp[40], errmsg *e)
{
    char name[NAME_ROOM];
    journal_shot t;
    r->camera_failed = 0;
    if (name_picture(name, r->s, p->i, p->j, k, e) != 0) return STAGE_FAILED;
    stage_code code = try_for(r, &t, p, arrived, k, name + name_stem(name), e);
    if (code != STAGE_OK) return code;
    free(t.beside);
    snprintf(temp, 40, "%s", t.temp);
    return r->stage->driver->check(r->stage, e);
}

stage_code shot_take(capture_run *r, const place *p, const double arrived[2], int k, errmsg *e)
{
    const session *s = r->s;
    journal_shot t, *known = journal_at(r->j, p->i, p->j)->shot;
    char name[NAME_ROOM], path[4096];
    struct stat st;
    r->camera_failed = 0;
    if (name_picture(name, s, p->i, p->j, k, e) != 0 ||
        files_join(path, sizeof path, s->folder, name, e) != 0 || files_make_parents(path, e) != 0)
        return STAGE_FAILED;
    if (lstat(path, &st) == 0 && !(known && known[k].digest[0])) {
        err_set(e, "%s: is there already and not from this session", path);
        return STAGE_FAILED;
    }
    stage_code code = try_for(r, &t, p, arrived, k, name + name_stem(name), e);
    if (code == STAGE_OK) return record(r, &t, p, k, name, e);
    errmsg why = *e;
    err_set(e, "node %d,%d exposure %d: %s", p->i, p->j, k, why.text);
    return code;
}
