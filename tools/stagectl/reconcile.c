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

typedef enum found { FOUND, MISSING, CHANGED } found;

static found compare(const journal_shot *t, const char *path, int full)
{
    struct stat st;
    char digest[65];
    int64_t size;
    errmsg ignored;
    if (lstat(path, &st) != 0) return MISSING;
    if (!S_ISREG(st.st_mode) || st.st_size != t->size) return CHANGED;
    int64_t mtime = (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec;
    if (!full && mtime == t->mtime_ns) return FOUND;
    return sha256_file(digest, &size, path, &ignored) == 0 && !strcmp(digest, t->digest) ? FOUND : CHANGED;
}

/* Temporary files of runs that were ended: what the journal needs of them has been renamed by now. */
static int sweep(const char *folder, errmsg *e)
{
    char path[4096];
    DIR *d = opendir(folder);
    if (!d) return err_errno(e, "%s", folder);
    for (struct dirent *f; (f = readdir(d));)
        if (!strncmp(f->d_name, ".shot-", 6) && files_join(path, sizeof path, folder, f->d_name, e) == 0)
            remove(path);
    closedir(d);
    return 0;
}

static int check_shot(journal_shot *t, const session *s, int i, int j, int k, int full, int repair,
                      void (*tell)(const char *), errmsg *e)
{
    char name[NAME_ROOM], path[4096], temp[4096];
    errmsg words;
    if (name_picture(name, s, i, j, k, e) != 0 || files_join(path, sizeof path, s->folder, name, e) != 0 ||
        files_join(temp, sizeof temp, s->folder, t->temp, e) != 0)
        return -1;
    found f = compare(t, path, full);
    if (f == FOUND) return 0;
    if (compare(t, temp, 1) == FOUND) { /* ended between the journal and the rename */
        if (!repair) return 0;
        if (rename(temp, path) != 0) return err_errno(e, "%s", path);
        return files_sync_parent(path, e);
    }
    err_set(&words, "%s: %s", path, f == MISSING ? "missing" : "not as it was taken");
    if (tell) tell(words.text);
    if (repair) t->taken = 0;
    return 1;
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
    if (repair && sweep(s->folder, e) != 0) return -1;
    return amiss;
}
