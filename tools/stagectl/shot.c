/* shot.c - one exposure, from the camera's command to a file that the journal vouches for. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "camera.h"
#include "capture.h"
#include "deadline.h"
#include "files.h"
#include "names.h"
#include "picture_in.h"
#include "sha256.h"

/* Exit code 0 is not trusted: the file must be there, new (its name never was), not empty, and whole. */
static int look_at(journal_shot *t, const session *s, const char *path, errmsg *e)
{
    struct stat st;
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
    return 0;
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
    argwords argv;
    if (name_command(&argv, s, p, arrived, k, path, e) != 0) return STAGE_FAILED;
    const camera_limits l = {s->exposure[k] + s->timeout, s->kill_after, s->error_text, r->log_fd,
                             r->camera_lock_fd};
    camera_result c = camera_run(&argv, &l, e);
    argwords_free(&argv);
    if (c == CAMERA_INTERRUPTED) return STAGE_INTERRUPTED;
    if (c == CAMERA_FAILED) return STAGE_FAILED;
    return look_at(t, s, path, e) == 0 ? STAGE_OK : STAGE_FAILED;
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

stage_code shot_take(capture_run *r, const place *p, const double arrived[2], int k, errmsg *e)
{
    const session *s = r->s;
    journal_shot t, *known = journal_at(r->j, p->i, p->j)->shot;
    char name[NAME_ROOM], path[4096], temp[4096];
    struct stat st;
    stage_code code = STAGE_FAILED;
    if (name_picture(name, s, p->i, p->j, k, e) != 0 ||
        files_join(path, sizeof path, s->folder, name, e) != 0 || files_make_parents(path, e) != 0)
        return STAGE_FAILED;
    /* What the journal knows may be replaced (it was found missing or changed), what it never saw may not. */
    if (lstat(path, &st) == 0 && !(known && known[k].digest[0])) {
        err_set(e, "%s: is there already and not from this session", path);
        return STAGE_FAILED;
    }
    const char *dot = strrchr(name, '.'), *ending = dot && !strchr(dot, '/') && strlen(dot) < 12 ? dot : "";
    for (int attempt = 0; attempt <= s->retries && code == STAGE_FAILED; attempt++) {
        memset(&t, 0, sizeof t);
        if (temp_name(t.temp, ending, e) != 0 || files_join(temp, sizeof temp, s->folder, t.temp, e) != 0)
            return STAGE_FAILED;
        code = expose(r, &t, p, arrived, k, temp, e);
        if (code == STAGE_OK) break;
        remove(temp);
        if (code == STAGE_FAILED && attempt < s->retries && r->say) {
            errmsg words;
            err_set(&words, "node %d,%d exposure %d: %s; trying again", p->i, p->j, k, e->text);
            r->say(words.text);
        }
    }
    if (code != STAGE_OK) {
        errmsg why = *e;
        err_set(e, "node %d,%d exposure %d: %s", p->i, p->j, k, why.text);
        return code;
    }
    /* The stage may have said something meanwhile: what it says first was the picture taken under. */
    if ((code = r->stage->driver->check(r->stage, e)) != STAGE_OK) {
        remove(temp);
        return code;
    }
    if (journal_shot_taken(r->j, p->i, p->j, k, &t, name, e) != 0) return STAGE_FAILED;
    r->pending_at = *p;
    r->pending[r->n_pending++] = k;
    return now_s() < r->committed_s + 1 || shots_commit(r, e) == 0 ? STAGE_OK : STAGE_FAILED;
}
