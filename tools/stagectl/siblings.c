/* siblings.c - see siblings.h. */
#include "siblings.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "asked.h"
#include "files.h"
#include "names.h"
#include "picture_in.h"
#include "sha256.h"

enum { MOST = 16 };

/* For each file of the exposure but the picture itself. */
typedef int sibling_fn(void *arg, const char *name, errmsg *e);

static int each(const session *s, const char *temp, sibling_fn *call, void *arg, errmsg *e)
{
    DIR *d = opendir(s->folder);
    if (!d) return err_errno(e, "%s", s->folder);
    int bad = 0;
    for (struct dirent *f; !bad && (f = readdir(d));)
        if (!strncmp(f->d_name, temp, TEMP_STEM) && strcmp(f->d_name, temp) != 0)
            bad = call(arg, f->d_name, e);
    closedir(d);
    return bad;
}

/* ---- the picture ------------------------------------------------------------------------------------ */

typedef struct looking {
    const char *temp;
    char found[300]; /* with the picture's ending, in other letters */
    char others[120];
} looking;

static int look(void *arg, const char *name, errmsg *e)
{
    looking *l = arg;
    (void)e;
    if (!strcasecmp(name, l->temp)) snprintf(l->found, sizeof l->found, "%s", name);
    size_t n = strlen(l->others);
    snprintf(l->others + n, sizeof l->others - n, " %s", name + TEMP_STEM);
    return 0;
}

int siblings_picture(const session *s, const char *temp, errmsg *e)
{
    char to[4096], from[4096];
    struct stat st;
    looking l = {.temp = temp};
    if (files_join(to, sizeof to, s->folder, temp, e) != 0) return -1;
    if (lstat(to, &st) == 0) return 0;
    if (each(s, temp, look, &l, e) != 0) return -1;
    if (l.found[0]) {
        if (files_join(from, sizeof from, s->folder, l.found, e) != 0) return -1;
        return rename(from, to) == 0 ? 0 : err_errno(e, "%s", to);
    }
    if (!l.others[0]) return 0; /* whoever looks at the picture will miss it */
    return err_set(e, "camera: expected a file that ends in %s as [output] file does, found%s",
                   temp[TEMP_STEM] ? temp + TEMP_STEM : "nothing", l.others);
}

/* ---- the others ------------------------------------------------------------------------------------- */

typedef struct gathering {
    journal_shot *t;
    const session *s;
} gathering;

static int gather(void *arg, const char *name, errmsg *e)
{
    const gathering *g = arg;
    journal_shot *t = g->t;
    char path[4096];
    struct stat st;
    journal_file f = {0};
    const char *rest = name + TEMP_STEM;
    int odd = !rest[0] || !strchr(".-_", rest[0]) || strlen(rest) >= sizeof f.rest;
    for (const char *p = rest; *p; p++) odd |= (unsigned char)*p <= ' ' || *p == '"' || *p == 0x7f;
    if (odd || t->n_beside >= MOST)
        return err_set(e, "camera: expected files beside {file} named {stem}.ENDING, at most %d, found '%s'",
                       MOST, rest);
    if (files_join(path, sizeof path, g->s->folder, name, e) != 0) return -1;
    if (lstat(path, &st) != 0 || !S_ISREG(st.st_mode))
        return err_set(e, "camera: what it wrote as {stem}%s is no file", rest);
    if (st.st_size == 0) return err_set(e, "camera: its file {stem}%s is empty", rest);
    if (g->s->check == CHECK_DECODE && ending_format(rest)[0] && picture_whole(path, e) != 0) return -1;
    if (sha256_file(f.digest, &f.size, path, e) != 0) return -1;
    if (lstat(path, &st) != 0) return err_errno(e, "%s", path);
    f.mtime_ns = (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec;
    snprintf(f.rest, sizeof f.rest, "%s", rest);
    journal_file *more = realloc(t->beside, (size_t)(t->n_beside + 1) * sizeof *more);
    if (!more) return err_set(e, "out of memory");
    t->beside = more;
    more[t->n_beside++] = f;
    return 0;
}

int siblings_find(journal_shot *t, const session *s, errmsg *e)
{
    gathering g = {t, s};
    if (each(s, t->temp, gather, &g, e) == 0) return 0;
    free(t->beside);
    t->beside = NULL;
    t->n_beside = 0;
    return -1;
}

static int drop(void *arg, const char *name, errmsg *e)
{
    const session *s = arg;
    char path[4096];
    if (files_join(path, sizeof path, s->folder, name, e) == 0) remove(path);
    return 0;
}

void siblings_remove(const session *s, const char *temp)
{
    errmsg ignored;
    char path[4096];
    if (files_join(path, sizeof path, s->folder, temp, &ignored) == 0) remove(path);
    each(s, temp, drop, (void *)(uintptr_t)s, &ignored);
}

/* ---- names ------------------------------------------------------------------------------------------ */

int siblings_paths(char temp[4096], char path[4096], const session *s, int i, int j, int k,
                   const journal_shot *t, const journal_file *f, errmsg *e)
{
    char name[NAME_ROOM], stem[TEMP_STEM + 1 + sizeof f->rest];
    snprintf(stem, sizeof stem, "%.*s%s", TEMP_STEM, t->temp, f->rest);
    if (name_picture(name, s, i, j, k, e) != 0) return -1;
    char beside[NAME_ROOM + sizeof f->rest];
    snprintf(beside, sizeof beside, "%.*s%s", name_stem(name), name, f->rest);
    return files_join(temp, 4096, s->folder, stem, e) != 0 ||
                   files_join(path, 4096, s->folder, beside, e) != 0
               ? -1
               : 0;
}

static int has(const journal_shot *t, const char *rest)
{
    for (int b = 0; t && b < t->n_beside; b++)
        if (!strcmp(t->beside[b].rest, rest)) return 1;
    return 0;
}

int siblings_are_new(const session *s, int i, int j, int k, const journal_shot *t, const journal_shot *known,
                     errmsg *e)
{
    char temp[4096], path[4096], name[NAME_ROOM];
    struct stat st;
    if (name_picture(name, s, i, j, k, e) != 0) return -1;
    for (int b = 0; b < t->n_beside; b++) {
        const char *rest = t->beside[b].rest;
        if (siblings_paths(temp, path, s, i, j, k, t, &t->beside[b], e) != 0) return -1;
        if (!strcmp(name + name_stem(name), rest) || (lstat(path, &st) == 0 && !has(known, rest)))
            return err_set(e, "%s: is there already and not from this session", path);
    }
    return 0;
}

int siblings_replace(const session *s, int i, int j, int k, const journal_shot *t, const journal_shot *known,
                     void (*say)(const char *), errmsg *e)
{
    char temp[4096], path[4096];
    errmsg words;
    for (int b = 0; known && b < known->n_beside; b++) {
        if (has(t, known->beside[b].rest)) continue;
        if (siblings_paths(temp, path, s, i, j, k, known, &known->beside[b], e) != 0) return -1;
        if (remove(path) != 0) {
            if (errno == ENOENT) continue;
            return err_errno(e, "%s", path);
        }
        err_set(&words, "%s: removed, it came with the exposure that was taken anew", path);
        if (say) say(words.text);
    }
    return 0;
}

int siblings_commit(const session *s, int i, int j, int k, const journal_shot *t, errmsg *e)
{
    char temp[4096], path[4096];
    for (int b = 0; b < t->n_beside; b++) {
        if (siblings_paths(temp, path, s, i, j, k, t, &t->beside[b], e) != 0) return -1;
        if (rename(temp, path) != 0) return err_errno(e, "%s", path);
    }
    return 0;
}
