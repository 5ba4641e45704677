/* journal_plan.c - what a journal is the journal of: the plan's identity and the files that the camera saw.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "journal_internal.h"

void journal_identity(char *out, size_t room, const session *s, const session_key *k)
{
    char value[4096];
    session_value(value, sizeof value, s, k);
    snprintf(out, room, "plan %s.%s %s", k->section, k->name, value);
}

/* Does the key belong to the plan's identity?  Lens and field of view do where the command has them. */
int journal_counts(const session *s, const session_key *k)
{
    char braces[64];
    if (k->identity != 2) return k->identity;
    snprintf(braces, sizeof braces, "{%s}", k->name);
    return strstr(s->command, braces) != NULL;
}

static int plan_differs(journal *j, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Kept, not told: a later "anew" may make it of no account. */
static int plan_differs(journal *j, const char *fmt, ...)
{
    char words[900];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(words, sizeof words, fmt, ap);
    va_end(ap);
    if (!j->changed)
        err_set(
            &j->why,
            "%s: the plan has changed: %s; use another folder for another plan, or --anew to take all again",
            j->path, words);
    j->changed = 1;
    return 0;
}

int journal_same_plan(journal *j, const char *words)
{
    char now[IDENTITY_ROOM];
    size_t name = strcspn(words + 5, " ");
    for (const session_key *k = session_keys; k->name; k++) {
        journal_identity(now, sizeof now, j->s, k);
        if (strncmp(now, words, 5 + name + 1) != 0) continue;
        j->met[(k - session_keys) / 64] |= (uint64_t)1 << (k - session_keys) % 64;
        if (!journal_counts(j->s, k) || !strcmp(now, words)) return 0;
        return plan_differs(j, "%.*s was '%.200s', is '%.200s'", (int)name, words + 5, words + 6 + name,
                            now + 6 + name);
    }
    return plan_differs(j, "%.*s is unknown", (int)name, words + 5);
}

/* A key that is younger than the journal: what it did was what the key's default does. */
void journal_whole_plan(journal *j)
{
    char now[IDENTITY_ROOM];
    for (const session_key *k = session_keys; k->name; k++) {
        int met = (j->met[(k - session_keys) / 64] >> (k - session_keys) % 64) & 1;
        if (met || k->identity != 1 || !k->preset) continue;
        session_value(now, sizeof now, j->s, k);
        if (strcmp(now, k->preset) != 0)
            plan_differs(j, "%s.%s is not on record, is '%.200s'", k->section, k->name, now);
    }
}

/* Strike off what is on record and write the plan as it is now. */
int journal_anew(journal *j, errmsg *e)
{
    char line[IDENTITY_ROOM];
    journal_strike_off(j);
    if (journal_append(j, e, "anew") != 0) return -1;
    for (const session_key *k = session_keys; k->name; k++) {
        if (!journal_counts(j->s, k)) continue;
        journal_identity(line, sizeof line, j->s, k);
        if (journal_append(j, e, "%s", line) != 0) return -1;
    }
    return 0;
}

/* ---- what the camera saw -------------------------------------------------------------------------- */

/* A file's digest on record, put there if it is not. */
int journal_note_seen(journal *j, const char *digest, const char *name)
{
    for (int k = 0; k < j->seen.n; k++)
        if (!strcmp(j->seen.file[k].name, name)) {
            snprintf(j->seen.file[k].digest, sizeof j->seen.file[k].digest, "%s", digest);
            return 0;
        }
    depend *more = realloc(j->seen.file, (size_t)(j->seen.n + 1) * sizeof *more);
    if (!more) return -1;
    j->seen.file = more;
    depend *f = &more[j->seen.n];
    *f = (depend){.name = strdup(name)};
    if (!f->name) return -1;
    snprintf(f->digest, sizeof f->digest, "%s", digest);
    j->seen.n++;
    return 0;
}

int journal_seen(journal *j, const depends *d, errmsg *e)
{
    const long shots = journal_shots(j);
    int adopted = 0;
    for (int k = 0; k < d->n; k++) {
        const depend *now = &d->file[k], *then = NULL;
        for (int q = 0; q < j->seen.n; q++)
            if (!strcmp(j->seen.file[q].name, now->name)) then = &j->seen.file[q];
        if (!now->digest[0] || (then && !strcmp(then->digest, now->digest))) continue;
        if (then && shots > 0)
            return err_set(e,
                           "%s: %s has changed since the capture began: the %ld exposures on disk show it as "
                           "it was; --anew takes them again, "
                           "another folder keeps them",
                           j->path, now->name, shots);
        adopted += !then && shots > 0;
        if (j->readonly) continue;
        if (journal_append(j, e, "seen %s %s", now->digest, now->name) != 0) return -1;
        if (journal_note_seen(j, now->digest, now->name) != 0) return err_set(e, "out of memory");
    }
    return adopted;
}
