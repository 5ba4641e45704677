/* trying.c - see trying.h. */
#include "trying.h"

#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "signals.h"

static const char by_id[] = "/dev/serial/by-id";

void trying_port_open(capture_run *r)
{
    trying *t = &r->trying;
    const char *folder = getenv("STAGECTL_BY_ID");
    char device[PATH_MAX], other[PATH_MAX], path[sizeof t->lasting];
    t->was_open = 1;
    if (t->lasting[0] || !realpath(r->port, device)) return;
    if (!folder) folder = by_id;
    DIR *d = opendir(folder);
    for (struct dirent *f; d && (f = readdir(d));) {
        int n = snprintf(path, sizeof path, "%s/%s", folder, f->d_name);
        if (f->d_name[0] == '.' || n < 0 || n >= (int)sizeof path) continue;
        if (realpath(path, other) && !strcmp(other, device))
            snprintf(t->lasting, sizeof t->lasting, "%s", path);
    }
    if (d) closedir(d);
}

const char *trying_port(const capture_run *r)
{
    return r->trying.lasting[0] ? r->trying.lasting : r->port;
}

static int worth(capture_run *r, stage_code code)
{
    enum { REFUSALS = 3 };
    trying *t = &r->trying;
    if (code == STAGE_GONE || code == STAGE_SILENT) return 1;
    if (code == STAGE_FAILED) return r->camera_failed || (t->was_open && t->port_failed);
    if (code == STAGE_REFUSED) return r->s->home && t->refusals++ < REFUSALS;
    return 0;
}

int trying_again(capture_run *r, stage_code *code, errmsg *e)
{
    enum { LONGEST = 60 };
    trying *t = &r->trying;
    errmsg words;
    if (r->shots_taken != t->shots) {
        t->shots = r->shots_taken;
        t->refusals = 0;
        t->rest_s = 0;
    }
    if (!r->keep_trying || !worth(r, *code)) return 0;
    t->rest_s = t->rest_s > 0 ? 2 * t->rest_s : 1;
    if (t->rest_s > LONGEST) t->rest_s = LONGEST;
    /* the stage may have lost power with its line: where it stood counts no more */
    if (!(*code == STAGE_FAILED && r->camera_failed) && r->s->home) r->assume_position = 0;
    if (strcmp(e->text, t->said.text) != 0 && r->say) {
        err_set(&words, "%s; keeps trying", e->text);
        r->say(words.text);
        t->said = *e;
    }
    if (signals_pause(t->rest_s) == 0) return 1;
    err_set(e, "interrupted while waiting for another try");
    *code = STAGE_INTERRUPTED;
    return 0;
}
