/*
 * capture.h - a session from its journal to its end.
 *
 * The order for each exposure, so that any end can be gone on from: camera writes a temporary file -> it is
 * looked at -> journal -> both synced -> rename.  For each place: journal "begin" -> move -> "arrived" ->
 * exposures -> list of times -> "done".  A sync costs 5 to 30 ms on a plain disk, several times the rest of
 * the work, so those of quick exposures are shared: at most a second of finished work, and never more than a
 * place, waits for its sync and its final name.  A killed run loses none of it (the next run does the
 * renaming); a power cut may.
 */
#ifndef CAPTURE_H
#define CAPTURE_H

#include "journal.h"
#include "plan.h"
#include "stage.h"

typedef struct capture_progress {
    long places_done, places;
    long shots, shots_most; /* on disk; of the whole session, without what auto leaves out */
    int i, j, k;            /* where it is */
    const char *doing;      /* "homing", "moving", "exposing" */
    double left_s;          /* estimate */
} capture_progress;

/* What --keep-trying remembers (trying.h). */
typedef struct trying {
    int was_open, port_failed; /* the port once in this run; not any more */
    char lasting[1024];        /* its name in /dev/serial/by-id; "" = it has none */
    int refusals;              /* of the stage, since the last exposure */
    long shots;
    double rest_s;
    errmsg said;
} trying;

/* What checks of the camera remember (cameracheck.h). */
typedef struct camera_checks {
    int unchecked; /* places since the last check */
    long since;    /* places since the last check that agreed, */
    int i, j;      /* the first of them */
    long at;       /* what is compared: index of its place + 1, 0 = not chosen yet */
    int k;         /* its exposure */
} camera_checks;

typedef struct capture_run {
    const session *s;
    journal *j;
    stage *stage; /* open() fills it on first need */
    const char *port;
    int assume_position;
    int keep_trying;
    int baud, dtr_off;                           /* of the command line; 0 = the session's */
    void (*say)(const char *words);              /* for the user, one line; may be NULL */
    void (*progress)(const capture_progress *p); /* after each step; may be NULL */
    capture_progress now;
    long shots_left_out; /* auto: exposures that no place needed */
    long shots_taken;    /* in this run */
    /* the capture's own */
    int log_fd, camera_fd; /* the camera's words; its process group (leftover.h) */
    double first[2];       /* f-number and ISO of the session's first picture; 0 = not known */
    int told;              /* what has been said once: TOLD_... */
    uint64_t told_time;    /* exposures whose time was said to be another */
    trying trying;
    camera_checks checks;
    int camera_failed; /* the last failure was the camera's */
    place pending_at;  /* recorded but not synced and renamed yet: these exposures of this place */
    int pending[EXPOSURES_MAX], n_pending;
    double committed_s;
    double started_s;
    long places_this_run;
    int guess;
    int was_known;              /* the stage's position, once in this run */
    long unchecked, doubt_from; /* places since the last look at the switches; index of the first of them */
    long in_doubt;              /* places that such a look called in doubt */
    double switch_at[2];        /* where they were just after homing, machine mm */
    int has_baseline, has_switch[2]; /* looked for; found */
} capture_run;

/* Compare the files with the journal.  full: read them all; else those whose size and time are as recorded
 * count as right.  With repair, files caught between journal and rename are renamed, left-over temporary
 * files removed, and missing or changed ones struck off so that they are taken again.  tell is called for
 * each thing amiss. Returns how many were amiss, or -1. */
long reconcile(journal *j, const session *s, int full, int repair, void (*tell)(const char *words),
               errmsg *e);

/* Sync, then give the pending exposures their names. */
int shots_commit(capture_run *r, errmsg *e);

/* Take exposure k there for a comparison: a temporary file in the session's folder, and nothing on record.
 * siblings_remove takes it away. */
stage_code shot_try(capture_run *r, const place *p, const double arrived[2], int k, char temp[40], errmsg *e);

/* Take exposure k at a place and journal it; commits what is pending once a second has passed. */
stage_code shot_take(capture_run *r, const place *p, const double arrived[2], int k, errmsg *e);

/* Remove the lists of times of all places: none of them is done any more. */
int times_remove(const session *s, errmsg *e);

/* Tell r->progress. */
void capture_show(capture_run *r, const char *doing);

/* All that is left of the session.  Returns the exit code (STAGE_OK, or why it ended). */
stage_code capture_all(capture_run *r, errmsg *e);

#endif
