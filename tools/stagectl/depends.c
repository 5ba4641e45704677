/* depends.c - see depends.h. */
#include "depends.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "camerawords.h"
#include "scenefiles.h"

void depends_free(depends *d)
{
    for (int k = 0; k < d->n; k++) free(d->file[k].name);
    free(d->file);
    d->file = NULL;
    d->n = 0;
}

static int add(depends *d, const char *name, const char *home, int must_exist, errmsg *e)
{
    depend *more = realloc(d->file, (size_t)(d->n + 1) * sizeof *more);
    char *path = NULL, *copy = strdup(name);
    if (more) d->file = more;
    if (!more || !copy || asprintf(&path, "%s%s", name[0] == '/' ? "" : home, name) < 0) {
        free(copy);
        return err_set(e, "out of memory");
    }
    depend *f = &d->file[d->n++];
    *f = (depend){.name = copy};
    errmsg why;
    int bad = scene_digest(f->digest, path, &why);
    free(path);
    if (!bad) return 0;
    f->digest[0] = 0;
    return must_exist ? err_set(e, "[camera] depends: %s", why.text) : 0;
}

static int of_command(depends *d, const session *s, int must_exist, errmsg *e)
{
    argwords words;
    if (camera_words(&words, s, e) != 0) return -1;
    int bad = 0;
    if (camera_is_virtual(&words)) {
        const char *octree = option_value(&words, "octree", 0), *falloff = option_value(&words, "falloff", 0);
        const char *response = option_value(&words, "response", 0);
        if (octree) bad = add(d, octree, "", must_exist, e);
        if (!bad && falloff) bad = add(d, falloff, "", must_exist, e);
        if (!bad && response && access(response, F_OK) == 0)
            bad = add(d, response, "", must_exist, e); /* or a curve's name */
    }
    argwords_free(&words);
    return bad;
}

int depends_find(depends *d, const session *s, int must_exist, errmsg *e)
{
    argwords named;
    *d = (depends){0};
    int bad = 0;
    if (!strcmp(s->depends, "auto")) {
        bad = of_command(d, s, must_exist, e);
    } else if (strcmp(s->depends, "none") != 0) {
        if (argwords_split(&named, s->depends, e) != 0) return -1;
        for (int k = 0; k < named.n && !bad; k++) bad = add(d, named.word[k], s->home_folder, must_exist, e);
        argwords_free(&named);
    }
    if (bad) depends_free(d);
    return bad;
}
