/* reconcile.c - do the files say what the journal says? */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "capture.h"
#include "files.h"
#include "names.h"
#include "sha256.h"
#include "siblings.h"

typedef enum found { FOUND, MISSING, CHANGED } found;

static found compare(const char *is, int64_t size, int64_t mtime_ns, const char *path, int full)
{
    struct stat st;
    char digest[65];
    int64_t its;
    errmsg ignored;
    if (lstat(path, &st) != 0) return MISSING;
    if (!S_ISREG(st.st_mode) || st.st_size != size) return CHANGED;
    int64_t mtime = (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec;
    if (!full && mtime == mtime_ns) return FOUND;
    return sha256_file(digest, &its, path, &ignored) == 0 && !strcmp(digest, is) ? FOUND : CHANGED;
}

/* A temporary file of an exposure on record that the record doesn't have: its camera wrote it too late, or an
 * older version, which did not look, left it.  It is somebody's picture. */
static int adopt(const char *folder, const char *temp, journal *j, const session *s,
                 void (*tell)(const char *), errmsg *e)
{
    char from[4096], to[4096], name[NAME_ROOM], beside[NAME_ROOM + 300];
    struct stat st;
    for (int jj = 0; jj < s->nodes[1]; jj++)
        for (int i = 0; i < s->nodes[0]; i++) {
            const journal_shot *shot = journal_at(j, i, jj)->shot;
            for (int k = 0; shot && k < s->exposures; k++) {
                if (!shot[k].taken || strncmp(shot[k].temp, temp, TEMP_STEM) != 0) continue;
                if (name_picture(name, s, i, jj, k, e) != 0) return -1;
                snprintf(beside, sizeof beside, "%.*s%s", name_stem(name), name, temp + TEMP_STEM);
                if (files_join(from, sizeof from, folder, temp, e) != 0 ||
                    files_join(to, sizeof to, folder, beside, e) != 0)
                    return -1;
                errmsg words;
                if (lstat(to, &st) == 0 || rename(from, to) != 0)
                    err_set(&words, "%s: came with %s, and is left where it is", from, name);
                else err_set(&words, "%s: came with %s and is not on record", to, name);
                if (tell) tell(words.text);
                return 1;
            }
        }
    return 0;
}

/* Temporary files of runs that were ended: what the journal needs of them has been renamed by now. */
static int sweep(const char *folder, journal *j, const session *s, void (*tell)(const char *), errmsg *e)
{
    char path[4096];
    int bad = 0;
    DIR *d = opendir(folder);
    if (!d) return err_errno(e, "%s", folder);
    for (struct dirent *f; bad >= 0 && (f = readdir(d));) {
        if (strncmp(f->d_name, ".shot-", 6) != 0) continue;
        bad = strlen(f->d_name) > TEMP_STEM ? adopt(folder, f->d_name, j, s, tell, e) : 0;
        if (bad == 0 && files_join(path, sizeof path, folder, f->d_name, e) == 0) remove(path);
    }
    closedir(d);
    return bad < 0 ? -1 : 0;
}

/* One file under its final name; where a run ended between the journal and the rename, the temporary one. */
static int check_file(const char *digest, int64_t size, int64_t mtime_ns, const char *path, const char *temp,
                      int full, int repair, void (*tell)(const char *), errmsg *e)
{
    errmsg words;
    found f = compare(digest, size, mtime_ns, path, full);
    if (f == FOUND) return 0;
    if (compare(digest, size, mtime_ns, temp, 1) == FOUND) {
        if (!repair) return 0;
        if (rename(temp, path) != 0) return err_errno(e, "%s", path);
        return files_sync_parent(path, e);
    }
    err_set(&words, "%s: %s", path, f == MISSING ? "missing" : "not as it was taken");
    if (tell) tell(words.text);
    return 1;
}

static int check_shot(journal_shot *t, const session *s, int i, int j, int k, int full, int repair,
                      void (*tell)(const char *), errmsg *e)
{
    char name[NAME_ROOM], path[4096], temp[4096];
    if (name_picture(name, s, i, j, k, e) != 0 || files_join(path, sizeof path, s->folder, name, e) != 0 ||
        files_join(temp, sizeof temp, s->folder, t->temp, e) != 0)
        return -1;
    int amiss = check_file(t->digest, t->size, t->mtime_ns, path, temp, full, repair, tell, e);
    for (int b = 0; b < t->n_beside && amiss >= 0; b++) {
        const journal_file *f = &t->beside[b];
        if (siblings_paths(temp, path, s, i, j, k, t, f, e) != 0) return -1;
        int one = check_file(f->digest, f->size, f->mtime_ns, path, temp, full, repair, tell, e);
        amiss = one < 0 ? one : amiss + one;
    }
    if (amiss > 0 && repair) t->taken = 0;
    return amiss;
}

long reconcile(journal *j, const session *s, int full, int repair, void (*tell)(const char *), errmsg *e)
{
    long amiss = 0;
    for (int jj = 0; jj < s->nodes[1]; jj++)
        for (int i = 0; i < s->nodes[0]; i++) {
            journal_place *p = journal_at(j, i, jj);
            for (int k = 0; p->shot && k < s->exposures; k++) {
                if (!p->shot[k].taken) continue;
                int r = check_shot(&p->shot[k], s, i, jj, k, full, repair, tell, e);
                if (r < 0) return -1;
                amiss += r;
                if (r && repair) p->done = 0;
            }
            if (repair && s->repeat_points && p->shot && !p->done)
                for (int k = 0; k < s->exposures; k++) p->shot[k].taken = 0;
        }
    if (repair && sweep(s->folder, j, s, tell, e) != 0) return -1;
    return amiss;
}
