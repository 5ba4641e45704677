/* session.c - reads a session file and checks that its parts fit together. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "argwords.h"
#include "asked.h"
#include "camerawords.h"
#include "fisheye.h"
#include "ini.h"
#include "names.h"
#include "positions.h"
#include "session_internal.h"
#include "stage.h"

enum { MAX_KEYS = 128, MAX_BYTES = 1 << 20 };

typedef struct reading {
    session *s;
    int given[MAX_KEYS]; /* line of each key, 0 = not there */
} reading;

static int take(void *arg, const char *section, const char *key, const char *value, int line, errmsg *e)
{
    reading *r = arg;
    int known_section = 0;
    for (int k = 0; session_keys[k].name; k++) {
        if (strcmp(section, session_keys[k].section) != 0) continue;
        known_section = 1;
        if (strcmp(key, session_keys[k].name) != 0) continue;
        if (r->given[k]) return err_set(e, "[%s] %s: given before, in line %d", section, key, r->given[k]);
        r->given[k] = line;
        errmsg why;
        return session_take(r->s, &session_keys[k], value, &why) == 0 ? 0
                                                                      : err_set(e, "%s: %s", key, why.text);
    }
    if (!known_section)
        return err_set(e, "expected [grid], [stage], [camera], [output] or [chain], found [%s]", section);
    return err_set(e, "unknown key '%s' in [%s] (stagectl keys lists them)", key, section);
}

static char *read_text(const char *path, errmsg *e)
{
    FILE *f = fopen(path, "r");
    char *text = f ? calloc(1, MAX_BYTES + 1) : NULL;
    size_t n = text ? fread(text, 1, MAX_BYTES + 1, f) : 0;
    int bad = 0;
    if (!f) bad = err_errno(e, "%s", path);
    else if (!text) bad = err_set(e, "%s: out of memory", path);
    else if (ferror(f)) bad = err_errno(e, "%s", path);
    else if (n > MAX_BYTES) bad = err_set(e, "%s: expected at most %d bytes", path, MAX_BYTES);
    else if (memchr(text, 0, n)) bad = err_set(e, "%s: expected text, found a zero byte", path);
    if (f) fclose(f);
    if (!bad) return text;
    free(text);
    return NULL;
}

/* A relative folder lies beside the session file. */
static int place_folder(session *s, const char *path, errmsg *e)
{
    const char *slash = strrchr(path, '/');
    int n = slash ? (int)(slash + 1 - path) : 0;
    char *full;
    free(s->home_folder);
    if (asprintf(&s->home_folder, "%.*s", n, path) < 0) s->home_folder = NULL;
    if (!s->home_folder) return err_set(e, "out of memory");
    if (s->folder[0] == '/' || !slash) return 0;
    if (asprintf(&full, "%s%s", s->home_folder, s->folder) < 0) return err_set(e, "out of memory");
    free(s->folder);
    s->folder = full;
    return 0;
}

/* What depends on the kind of camera: a virtual one renders for minutes at a place's first exposure; gphoto2
 * prints an error and exits with 0. */
static int settle_kind(session *s, errmsg *e)
{
    argwords words;
    if (camera_words(&words, s, e) != 0) return -1;
    if (!(s->timeout > 0)) s->timeout = camera_is_virtual(&words) ? 3600 : 30;
    int bad = 0;
    if (!strcmp(s->error_text, "auto")) {
        char *text = strdup(camera_runs(&words, "gphoto2") ? "*** Error" : "");
        if (text) {
            free(s->error_text);
            s->error_text = text;
        } else bad = err_set(e, "out of memory");
    }
    argwords_free(&words);
    return bad;
}

/* A label that reads as a time has to be its exposure's. */
static int check_labels(const session *s, const argwords *labels, errmsg *e)
{
    if (labels->n != 0 && labels->n != s->exposures)
        return err_set(e, "[camera] labels: expected %d, one for each exposure, found %d", s->exposures,
                       labels->n);
    if (labels->n == 0 && (strstr(s->command, "{label}") || strstr(s->expect_text, "{label}")))
        return err_set(e, "[camera] labels: expected them for {label}");
    for (int k = 0; k < labels->n && s->list_times == TIMES_ASKED; k++) {
        double t = asked_label(labels->word[k]);
        if (t > 0 && fabs(log(t / s->exposure[k])) > log1p(s->time_tolerance) + 1e-9)
            return err_set(
                e, "[camera] labels: expected a word for %.6g s, found '%s' (a list of its own: exposures)",
                s->exposure[k], labels->word[k]);
    }
    return 0;
}

static int check(const session *s, errmsg *e)
{
    camera_frame c;
    argwords words;
    const int origin[2] = {0, 0};
    if (camera_at_node(&c, s->plane, s->nodes, origin, e) != 0) return -1;
    if (!stage_driver_by_name(s->driver))
        return err_set(e, "[stage] driver: expected grbl or c4, found '%s'", s->driver);
    if (!s->folder[0]) return err_set(e, "[output] folder: expected a name");
    if (stage_homing_check(s->homing, e) != 0) return -1;
    if (s->check_home > 0 && !s->home) return err_set(e, "[stage] check_home: expected home = yes with it");
    for (int a = 0; a < 2; a++)
        if ((s->travel[2 * a] != 0 || s->travel[2 * a + 1] != 0) &&
            !(s->travel[2 * a] < s->travel[2 * a + 1]))
            return err_set(e, "[stage] travel: expected lowest below highest, found %g and %g",
                           s->travel[2 * a], s->travel[2 * a + 1]);
    if (argwords_split(&words, s->command, e) != 0) return -1;
    int empty = words.n == 0;
    argwords_free(&words);
    if (empty) return err_set(e, "[camera] command: expected a program");
    if (argwords_split(&words, s->labels, e) != 0) return -1;
    int bad_labels = check_labels(s, &words, e);
    argwords_free(&words);
    if (bad_labels) return -1;
    if (!strstr(s->command, "{file}") && !strstr(s->command, "{stem}"))
        return err_set(e, "[camera] command: expected {file} in it");
    if (!strcmp(s->times, "exif") || !strcmp(s->times, "asked"))
        return err_set(e,
                       "[output] times: expected the name of a list, found '%s', which belongs in [camera]",
                       s->times);
    /* Names are tried on two nodes: each exposure of each place needs a name of its own. */
    if (names_check(s, e) != 0) return -1;
    return camera_agrees(s, e);
}

int session_load(session *out, const char *path, errmsg *e)
{
    session s = {0};
    reading r = {.s = &s};
    errmsg why;
    int bad = 0;
    char *text = read_text(path, e);
    if (!text) return -1;
    for (int k = 0; session_keys[k].name && !bad; k++)
        if (session_keys[k].preset) bad = session_take(&s, &session_keys[k], session_keys[k].preset, e);
    if (!bad) bad = ini_parse(text, path, take, &r, e);
    for (int k = 0; session_keys[k].name && !bad; k++)
        if (!session_keys[k].preset && !r.given[k])
            bad =
                err_set(e, "%s: expected '%s' in [%s]", path, session_keys[k].name, session_keys[k].section);
    if (!bad && check(&s, &why) != 0) bad = err_set(e, "%s: %s", path, why.text);
    if (!bad) bad = settle_kind(&s, e);
    if (!bad) bad = place_folder(&s, path, e);
    if (!bad) bad = positions_load(&s, e);
    free(text);
    if (bad) {
        session_free(&s);
        return -1;
    }
    *out = s;
    return 0;
}

void session_free(session *s)
{
    char **texts[] = {&s->driver,      &s->port,           &s->axes,      &s->command,     &s->labels,
                      &s->error_text,  &s->exposures_text, &s->folder,    &s->file,        &s->times,
                      &s->before,      &s->beside,         &s->hdrgen,    &s->fishremap,   &s->ilfpack,
                      &s->light_field, &s->depends,        &s->lens,      &s->home_folder, &s->expect_text,
                      &s->homing,      &s->ilflamps,       &s->positions, &s->next};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        free(*texts[i]);
        *texts[i] = NULL;
    }
    free(s->listed);
    s->listed = NULL;
}
