/* cameracheck.c - see cameracheck.h. */
#include "cameracheck.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "files.h"
#include "names.h"
#include "samepicture.h"
#include "siblings.h"

/* The first place that is done, and its exposure of most contrast: 1; 0: there is none. */
static int reference(place *p, int *k, char path[4096], capture_run *r, errmsg *e)
{
    const session *s = r->s;
    camera_checks *t = &r->checks;
    char name[NAME_ROOM], other[4096];
    if (t->at > 0) {
        plan_place(p, s, t->at - 1);
        *k = t->k;
        return name_picture(name, s, p->i, p->j, *k, e) != 0 ||
                       files_join(path, 4096, s->folder, name, e) != 0
                   ? -1
                   : 1;
    }
    for (long index = 0; index < plan_places(s); index++) {
        plan_place(p, s, index);
        const journal_place *jp = journal_at(r->j, p->i, p->j);
        double best = -1;
        for (int q = 0; jp->done && jp->shot && q < s->exposures; q++) {
            double contrast;
            if (!jp->shot[q].taken) continue;
            if (name_picture(name, s, p->i, p->j, q, e) != 0 ||
                files_join(other, sizeof other, s->folder, name, e) != 0 ||
                picture_contrast(&contrast, other, s->circle, e) != 0)
                return -1;
            if (contrast <= best) continue;
            best = contrast;
            *k = q;
            snprintf(path, 4096, "%s", other);
        }
        if (best > 0) {
            t->at = index + 1;
            t->k = *k;
            return 1;
        }
    }
    return 0;
}

/* Two more at the reference's place, against it and against each other. */
static stage_code compare(picture_difference d[2], capture_run *r, const place *p, int k, const char *path,
                          const double *from, errmsg *e)
{
    const session *s = r->s;
    stage *st = r->stage;
    double way[2][2], arrived[2];
    char state[32], temp[2][40] = {{0}}, now[2][4096];
    stage_code c = st->driver->check(st, e);
    int n = plan_path(way, s, from, p->machine);
    if (c == STAGE_OK) c = st->driver->go(st, (const double(*)[2])way, n, s->feed, s->settle, e);
    if (c == STAGE_OK) c = st->driver->where(st, arrived, state, e);
    /* whoever goes on after a kill has to know where it stands */
    if (c == STAGE_OK && journal_arrived(r->j, p->i, p->j, arrived, e) != 0) c = STAGE_FAILED;
    for (int q = 0; q < 2 && c == STAGE_OK; q++) {
        c = shot_try(r, p, arrived, k, temp[q], e);
        if (c == STAGE_OK && files_join(now[q], sizeof now[q], s->folder, temp[q], e) != 0) c = STAGE_FAILED;
    }
    if (c == STAGE_OK && (picture_differ(&d[0], path, now[0], s->circle, e) != 0 ||
                          picture_differ(&d[1], now[0], now[1], s->circle, e) != 0))
        c = STAGE_FAILED;
    for (int q = 0; q < 2; q++)
        if (temp[q][0]) siblings_remove(s, temp[q]);
    return c;
}

static void tell(capture_run *r, const place *p, const picture_difference d[2])
{
    const camera_checks *t = &r->checks;
    char doubt[100] = "what is on record";
    errmsg words;
    if (t->since > 0)
        snprintf(doubt, sizeof doubt, "the %ld place%s from node %d,%d on", t->since,
                 t->since == 1 ? "" : "s", t->i, t->j);
    err_set(&words,
            "the picture at node %d,%d differs from the one on record by %.2g %% of its contrast (two in a "
            "row: %.2g %%), "
            "as if displaced by %.2g,%.2g pixels: camera, stage or light has changed; in doubt: %s",
            p->i, p->j, 100 * d[0].share, 100 * d[1].share, d[0].shift[0], d[0].shift[1], doubt);
    if (r->say) r->say(words.text);
}

stage_code camera_check(capture_run *r, const place *last, int begin, int end, double at[2],
                        const double **from, errmsg *e)
{
    camera_checks *t = &r->checks;
    picture_difference d[2] = {0};
    char path[4096];
    place p;
    int k = 0;
    if (r->s->check_picture == 0 || !r->stage->port) return STAGE_OK;
    if (!begin && !end && t->since++ == 0) {
        t->i = last->i;
        t->j = last->j;
    }
    if (!begin && (end ? t->unchecked == 0 : ++t->unchecked < r->s->check_picture)) return STAGE_OK;
    int there = reference(&p, &k, path, r, e);
    if (there < 0) return STAGE_FAILED;
    if (!there) return STAGE_OK;
    t->unchecked = 0;
    stage_code c = compare(d, r, &p, k, path, *from, e);
    if (c != STAGE_OK) return c;
    memcpy(at, p.machine, 2 * sizeof *at);
    *from = at;
    if (journal_check(r->j, p.i, p.j, k, (double[4]){d[0].share, d[1].share, d[0].shift[0], d[0].shift[1]},
                      e) != 0)
        return STAGE_FAILED;
    if (d[0].share > r->s->check_difference && d[0].share > 2 * d[1].share) tell(r, &p, d);
    else t->since = 0;
    return STAGE_OK;
}
