/* journal_internal.h - what journal.c (records, lines, opening) and journal_plan.c (what it is the journal
 * of) share. */
#ifndef JOURNAL_INTERNAL_H
#define JOURNAL_INTERNAL_H

#include <sys/types.h>

#include "journal.h"

enum { IDENTITY_ROOM = 4200 };

struct journal {
    const session *s;
    char *path;
    int fd, lock_fd;
    off_t length; /* of the good part, bytes */
    journal_place *place;
    int readonly, dropped, has_steps, has_last;
    double steps[2], last[2];
    depends seen; /* files as on record */
    int changed;  /* the plan on record is another: why */
    errmsg why;
    uint64_t met[2];   /* rows of session_keys that the plan on record has */
    int ahead[3];      /* the exposure that the records "says" and "beside" last read are of */
    journal_shot next; /* what they say */
};

/* journal.c */
int journal_append(journal *j, errmsg *e, const char *fmt, ...) __attribute__((format(printf, 3, 4)));
void journal_strike_off(
    journal *j); /* what is on record counts no longer, but its files are known to be ours */

journal_place *journal_node(journal *j, int i, int jj); /* NULL: no such place */

/* journal_shots.c */
int journal_replay_shot(journal *j, int i, int jj, int k, journal_shot *t);
int journal_replay_ahead(journal *j, const char *words);
void journal_forget_ahead(journal *j); /* the records "says" and "beside" whose shot never came */

/* journal_plan.c */
int journal_counts(const session *s, const session_key *k); /* is it part of the plan's identity? */
void journal_identity(char *out, size_t room, const session *s, const session_key *k);
int journal_same_plan(journal *j, const char *words); /* of a "plan" record: notes what differs in j->why */
void journal_whole_plan(journal *j);                  /* after all of them */
int journal_note_seen(journal *j, const char *digest, const char *name);

#endif
