/*
 * journal.h - what has been done, so that any end can be gone on from.
 *
 * A text file, only ever appended to.  Each line is one record: eight hex digits of CRC-32, a blank, the
 * words.
 *
 *   stagectl-journal 1            first
 *   plan SECTION.KEY VALUE        the plan's identity, one line a key
 *   seen DIGEST NAME              a file that decides what the camera sees, by its contents (depends.h)
 *   anew                          all above is struck off; the plan and files that follow count
 *   steps X Y                     steps/mm of the controller that it was begun with
 *   run SECONDS                   a run begins (Unix time)
 *   begin I J                     a place begins
 *   arrived I J X Y               it stands there: measured machine position, mm
 *   stopped X Y                   a run that ended early left the stage standing there, mm
 *   says I J K SECONDS F ISO      what the picture of the shot that follows states of itself; 0 = nothing
 *   beside I J K SIZE MTIME DIGEST TEMP NAME
 *                                 a file that came with the shot that follows (raw beside JPEG)
 *   shot I J K SIZE MTIME DIGEST CLIP BLACK TEMP NAME
 *                                 exposure K is on disk under the name TEMP and about to be renamed to NAME
 *   done I J                      the place is finished
 *   check I J K SHARE NOISE X Y   its exposure K taken again and compared (cameracheck.h)
 *
 * The shot is recorded, and record and file are synced, before the rename: whatever happens between the two,
 * the next run finds either the whole file under its name or the whole file under the temporary one, and the
 * digest tells. A torn last line is dropped; a bad line before the last is damage and refused.
 */
#ifndef JOURNAL_H
#define JOURNAL_H

#include <stdint.h>

#include "depends.h"
#include "session.h"

typedef struct journal journal;

/* A file that came with a picture: its name is the picture's without the ending, then rest. */
typedef struct journal_file {
    int64_t size, mtime_ns;
    char digest[65];
    char rest[40];
} journal_file;

/* ".shot-" and 16 digits: what the temporary names of a shot's files have in common */
enum { TEMP_STEM = 22 };

typedef struct journal_shot {
    int taken;
    int64_t size; /* bytes */
    int64_t mtime_ns;
    char digest[65];               /* SHA-256 */
    double clip, black;            /* shares of the pixels */
    char temp[40];                 /* name of the temporary file in the session's folder */
    double seconds, f_number, iso; /* as the picture states them; 0 = it doesn't */
    journal_file *beside;          /* files that came with it, n_beside of them */
    int n_beside;
    char format[8]; /* of the picture, while it is fresh */
} journal_shot;

typedef struct journal_place {
    int begun, done;
    int has_arrived;
    double arrived[2];
    journal_shot *shot; /* exposures of them; NULL before the first */
} journal_place;

typedef enum journal_mode {
    JOURNAL_GO_ON,
    JOURNAL_READ, /* for verify and status; no lock, no writing, and the journal has to be there */
    JOURNAL_ANEW  /* whatever its plan: journal_anew follows */
} journal_mode;

/* Open or begin the journal of a session in its folder, which must exist.  Refuses a plan that differs from
 * the one it was begun with, naming the difference, and a session that another process is at work on. */
int journal_open(journal **j, const session *s, int mode, errmsg *e);

/* Strike off what is on record and begin again in the same file, by the plan as it is now. */
int journal_anew(journal *j, errmsg *e);

/* Compare the files that the camera's view depends on with those on record, and put on record what is not.  A
 * changed one is refused while exposures are on record.  Returns how many were taken as they are though
 * exposures stand on record from before such records were made (to be told), or -1. */
int journal_seen(journal *j, const depends *d, errmsg *e);
void journal_close(journal *j); /* NULL allowed */

/* Its places, nodes[0] * nodes[1] of them, by i + j * nodes[0]. */
journal_place *journal_at(journal *j, int i, int jj);
long journal_shots(const journal *j);                 /* exposures on record and not struck off */
int journal_dropped(const journal *j);                /* 1: a torn last line was dropped */
const double *journal_steps(const journal *j);        /* steps/mm; NULL = not on record yet */
const double *journal_last_arrived(const journal *j); /* or stopped at; NULL = never */

/* Append.  They keep what journal_at gives in step.  A record survives the end of this process at once, and a
 * power cut from the next journal_sync on, which also makes everything durable that was written to the folder
 * before. */
int journal_sync(journal *j, errmsg *e);
int journal_run(journal *j, errmsg *e);
int journal_set_steps(journal *j, const double steps[2], errmsg *e);
int journal_begin(journal *j, int i, int jj, errmsg *e);
int journal_arrived(journal *j, int i, int jj, const double xy[2], errmsg *e);
int journal_stopped(journal *j, const double xy[2], errmsg *e);
/* Takes shot->beside over, whatever comes of it. */
int journal_shot_taken(journal *j, int i, int jj, int k, const journal_shot *shot, const char *name,
                       errmsg *e);
int journal_done(journal *j, int i, int jj, errmsg *e);
int journal_check(journal *j, int i, int jj, int k, const double found[4], errmsg *e);

#endif
