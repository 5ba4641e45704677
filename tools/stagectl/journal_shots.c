/*
 * journal_shots.c - the records of an exposure: "shot", and ahead of it what its picture says of itself and
 * which files came with it (journal.h).
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "journal_internal.h"
#include "names.h"

/* Takes shot->beside over. */
static int note_shot(journal *j, journal_place *p, int k, const journal_shot *shot)
{
    int ok = p && k >= 0 && k < j->s->exposures;
    if (ok && !p->shot) p->shot = calloc((size_t)j->s->exposures, sizeof *p->shot);
    if (!ok || !p->shot) {
        free(shot->beside);
        return -1;
    }
    free(p->shot[k].beside);
    p->shot[k] = *shot;
    p->shot[k].taken = 1;
    return 0;
}

/* ---- what stands before a shot's own record ---------------------------------------------------- */

void journal_forget_ahead(journal *j)
{
    free(j->next.beside);
    j->next = (journal_shot){0};
    j->ahead[0] = -1;
}

static void ahead_of(journal *j, int i, int jj, int k)
{
    if (j->ahead[0] != i || j->ahead[1] != jj || j->ahead[2] != k) journal_forget_ahead(j);
    j->ahead[0] = i;
    j->ahead[1] = jj;
    j->ahead[2] = k;
}

static int note_beside(journal *j, const journal_file *f)
{
    journal_file *more = realloc(j->next.beside, (size_t)(j->next.n_beside + 1) * sizeof *more);
    if (!more) return -1;
    j->next.beside = more;
    more[j->next.n_beside++] = *f;
    return 0;
}

int journal_replay_shot(journal *j, int i, int jj, int k, journal_shot *t)
{
    if (j->ahead[0] == i && j->ahead[1] == jj && j->ahead[2] == k) {
        t->seconds = j->next.seconds;
        t->f_number = j->next.f_number;
        t->iso = j->next.iso;
        t->beside = j->next.beside;
        t->n_beside = j->next.n_beside;
        j->next = (journal_shot){0};
    }
    journal_forget_ahead(j);
    return note_shot(j, journal_node(j, i, jj), k, t);
}

/* A record "says" or "beside": 1; another: 0; out of memory: -1. */
int journal_replay_ahead(journal *j, const char *w)
{
    int i, jj, k, at = 0;
    journal_shot t = {0};
    if (sscanf(w, "says %d %d %d %lf %lf %lf%n", &i, &jj, &k, &t.seconds, &t.f_number, &t.iso, &at) == 6 &&
        !w[at] && isfinite(t.seconds) && isfinite(t.f_number) && isfinite(t.iso)) {
        ahead_of(j, i, jj, k);
        j->next.seconds = t.seconds;
        j->next.f_number = t.f_number;
        j->next.iso = t.iso;
        return 1;
    }
    journal_file f = {0};
    char temp[TEMP_STEM + sizeof f.rest];
    if (sscanf(w, "beside %d %d %d %" SCNd64 " %" SCNd64 " %64s %61s", &i, &jj, &k, &f.size, &f.mtime_ns,
               f.digest, temp) == 7 &&
        f.size >= 0 && strlen(temp) > TEMP_STEM && !strchr(temp, '/')) {
        snprintf(f.rest, sizeof f.rest, "%s", temp + TEMP_STEM);
        ahead_of(j, i, jj, k);
        return note_beside(j, &f) == 0 ? 1 : -1;
    }
    return 0;
}

int journal_shot_taken(journal *j, int i, int jj, int k, const journal_shot *t, const char *name, errmsg *e)
{
    int bad = 0;
    if (t->seconds > 0 || t->f_number > 0 || t->iso > 0)
        bad = journal_append(j, e, "says %d %d %d %.10g %.10g %.10g", i, jj, k, t->seconds, t->f_number,
                             t->iso);
    const int stem = name_stem(name);
    for (int b = 0; b < t->n_beside && !bad; b++) {
        const journal_file *f = &t->beside[b];
        bad =
            journal_append(j, e, "beside %d %d %d %" PRId64 " %" PRId64 " %s %.*s%s %.*s%s", i, jj, k,
                           f->size, f->mtime_ns, f->digest, TEMP_STEM, t->temp, f->rest, stem, name, f->rest);
    }
    if (bad) {
        free(t->beside);
        return -1;
    }
    if (note_shot(j, journal_at(j, i, jj), k, t) != 0) return err_set(e, "out of memory");
    return journal_append(j, e, "shot %d %d %d %" PRId64 " %" PRId64 " %s %.6g %.6g %s %s", i, jj, k, t->size,
                          t->mtime_ns, t->digest, t->clip, t->black, t->temp, name);
}
