/* journal.c - the journal of journal.h. */
#include "journal.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <zlib.h>

#include "base/outfile.h"
#include "journal_internal.h"
#include "leftover.h"

static const char heading[] = "stagectl-journal 1";

/* ---- records in memory ----------------------------------------------------------------------- */

journal_place *journal_at(journal *j, int i, int jj)
{
    return &j->place[(size_t)i + (size_t)jj * (size_t)j->s->nodes[0]];
}

long journal_shots(const journal *j)
{
    size_t places = (size_t)j->s->nodes[0] * (size_t)j->s->nodes[1];
    long n = 0;
    for (size_t p = 0; p < places; p++)
        for (int k = 0; j->place[p].shot && k < j->s->exposures; k++) n += j->place[p].shot[k].taken;
    return n;
}

int journal_dropped(const journal *j)
{
    return j->dropped;
}

const double *journal_steps(const journal *j)
{
    return j->has_steps ? j->steps : NULL;
}

const double *journal_last_arrived(const journal *j)
{
    return j->has_last ? j->last : NULL;
}

journal_place *journal_node(journal *j, int i, int jj)
{
    int ok = i >= 0 && jj >= 0 && i < j->s->nodes[0] && jj < j->s->nodes[1];
    return ok ? journal_at(j, i, jj) : NULL;
}

/* What is on record counts no longer, but its files are known to be ours. */
void journal_strike_off(journal *j)
{
    size_t places = (size_t)j->s->nodes[0] * (size_t)j->s->nodes[1];
    for (size_t p = 0; p < places; p++) {
        journal_shot *shot = j->place[p].shot;
        for (int k = 0; shot && k < j->s->exposures; k++) shot[k].taken = 0;
        j->place[p] = (journal_place){.shot = shot};
    }
    j->has_steps = j->has_last = j->changed = 0;
    memset(j->met, 0, sizeof j->met);
    depends_free(&j->seen);
}

/* The words of one good record.  0, or -1 when they make no sense. */
static int replay(journal *j, const char *w)
{
    int i, jj, k, at = 0;
    double x, y;
    journal_shot t = {0};
    if (!strncmp(w, "check ", 6)) return 0; /* for the reader */
    if (!strncmp(w, "run ", 4)) {           /* a run ended before the shot that these were ahead of */
        journal_forget_ahead(j);
        return 0;
    }
    if (!strcmp(w, "anew")) {
        journal_strike_off(j);
        return 0;
    }
    if (!strncmp(w, "seen ", 5) && strspn(w + 5, "0123456789abcdef") == 64 && w[69] == ' ' && w[70]) {
        char digest[65];
        memcpy(digest, w + 5, 64);
        digest[64] = 0;
        return journal_note_seen(j, digest, w + 70);
    }
    if (sscanf(w, "steps %lf %lf%n", &x, &y, &at) == 2 && !w[at] && isfinite(x) && isfinite(y)) {
        j->steps[0] = x;
        j->steps[1] = y;
        j->has_steps = 1;
        return 0;
    }
    if (sscanf(w, "begin %d %d%n", &i, &jj, &at) == 2 && !w[at] && journal_node(j, i, jj)) {
        journal_node(j, i, jj)->begun = 1;
        return 0;
    }
    if (sscanf(w, "arrived %d %d %lf %lf%n", &i, &jj, &x, &y, &at) == 4 && !w[at] && journal_node(j, i, jj) &&
        isfinite(x) && isfinite(y)) {
        journal_place *p = journal_node(j, i, jj);
        p->has_arrived = j->has_last = 1;
        p->arrived[0] = j->last[0] = x;
        p->arrived[1] = j->last[1] = y;
        return 0;
    }
    if (sscanf(w, "stopped %lf %lf%n", &x, &y, &at) == 2 && !w[at] && isfinite(x) && isfinite(y)) {
        j->has_last = 1;
        j->last[0] = x;
        j->last[1] = y;
        return 0;
    }
    if (sscanf(w, "shot %d %d %d %" SCNd64 " %" SCNd64 " %64s %lf %lf %39s", &i, &jj, &k, &t.size,
               &t.mtime_ns, t.digest, &t.clip, &t.black, t.temp) == 9 &&
        t.size >= 0 && isfinite(t.clip) && isfinite(t.black) &&
        !strchr(t.temp, '/')) /* in the folder itself */
        return journal_replay_shot(j, i, jj, k, &t);
    const int ahead = journal_replay_ahead(j, w);
    if (ahead != 0) return ahead > 0 ? 0 : -1;
    if (sscanf(w, "done %d %d%n", &i, &jj, &at) == 2 && !w[at] && journal_node(j, i, jj)) {
        journal_node(j, i, jj)->done = 1;
        return 0;
    }
    return -1;
}

/* ---- lines ----------------------------------------------------------------------------------- */

static uint32_t crc_of(const char *s, size_t n)
{
    return (uint32_t)crc32(crc32(0, NULL, 0), (const Bytef *)s, (uInt)n);
}

/* Words of a line if its checksum is right. */
static const char *checked(const char *line, size_t n)
{
    char *end;
    if (n < 10 || line[8] != ' ') return NULL;
    unsigned long crc = strtoul(line, &end, 16);
    return end == line + 8 && crc == crc_of(line + 9, n - 9) ? line + 9 : NULL;
}

int journal_append(journal *j, errmsg *e, const char *fmt, ...)
{
    char line[4096];
    va_list ap;
    va_start(ap, fmt);
    int n = vsnprintf(line + 9, sizeof line - 10, fmt, ap);
    va_end(ap);
    if (n < 0 || (size_t)n >= sizeof line - 10) return err_set(e, "%s: a record is too long", j->path);
    char crc[10];
    snprintf(crc, sizeof crc, "%08" PRIx32 " ", crc_of(line + 9, (size_t)n));
    memcpy(line, crc, 9);
    line[9 + n] = '\n';
    size_t left = (size_t)n + 10;
    int bad = 0;
    for (const char *p = line; left > 0 && !bad;) {
        ssize_t w = write(j->fd, p, left);
        if (w < 0 && errno == EINTR) continue;
        if (w < 0) bad = err_errno(e, "%s", j->path);
        else {
            p += w;
            left -= (size_t)w;
        }
    }
    if (!bad) j->length += n + 10;
    else if (ftruncate(j->fd, j->length) != 0) return bad; /* half a record must not stand before the next */
    return bad;
}

/* ---- opening --------------------------------------------------------------------------------- */

/* A new journal comes whole or not at all: heading and plan are written aside and renamed. */
static int create(journal *j, errmsg *e)
{
    outfile *o;
    char line[IDENTITY_ROOM];
    if (out_begin(&o, j->path, e) != 0) return -1;
    FILE *f = out_stream(o);
    fprintf(f, "%08" PRIx32 " %s\n", crc_of(heading, strlen(heading)), heading);
    for (const session_key *k = session_keys; k->name; k++) {
        if (!journal_counts(j->s, k)) continue;
        journal_identity(line, sizeof line, j->s, k);
        fprintf(f, "%08" PRIx32 " %s\n", crc_of(line, strlen(line)), line);
    }
    return out_commit(o, e);
}

/* Read all records; *whole gets the length of the good part. */
static int read_all(journal *j, off_t *whole, errmsg *e)
{
    struct stat st;
    int bad = 0;
    if (fstat(j->fd, &st) != 0) return err_errno(e, "%s", j->path);
    if (st.st_size > (off_t)1 << 30) return err_set(e, "%s: too long for a journal", j->path);
    if (st.st_size == 0) return err_set(e, "%s: expected '%s', found an empty file", j->path, heading);
    size_t size = (size_t)st.st_size, got = 0;
    char *text = malloc(size + 1);
    if (!text) return err_set(e, "%s: out of memory", j->path);
    while (got < size) {
        ssize_t n = pread(j->fd, text + got, size - got, (off_t)got);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) break;
        got += (size_t)n;
    }
    if (got < size) bad = err_errno(e, "%s", j->path);
    text[got] = 0;
    *whole = 0;
    int line_no = 0;
    /* before the last "anew" another plan may have been at work: its records count only where they fit */
    int old = memmem(text, size, " anew\n", 6) != NULL;
    for (char *at = text; !bad && at < text + size;) {
        char *end = memchr(at, '\n', (size_t)(text + size - at));
        const char *words = NULL;
        line_no++;
        if (end) {
            *end = 0;
            words = checked(at, (size_t)(end - at));
        }
        int is_last = !end || end + 1 == text + size;
        if (!words && is_last && line_no > 1) {
            j->dropped = 1;
            break;
        }
        if (line_no == 1 && (!words || strcmp(words, heading) != 0))
            bad = err_set(e, "%s: expected '%s', found another kind of file or version", j->path, heading);
        else if (!words) bad = err_set(e, "%s: line %d is damaged", j->path, line_no);
        else if (!strncmp(words, "plan ", 5)) bad = journal_same_plan(j, words);
        else if (line_no > 1 && replay(j, words) != 0 && !old)
            bad = err_set(e, "%s: line %d makes no sense here", j->path, line_no);
        if (words && !strcmp(words, "anew"))
            old = end && memmem(end, (size_t)(text + size - end), " anew\n", 6) != NULL;
        if (end) {
            at = end + 1;
            *whole = at - text;
        }
    }
    free(text);
    if (!bad) journal_whole_plan(j);
    return bad;
}

static int lock_folder(journal *j, errmsg *e)
{
    char *path;
    if (asprintf(&path, "%s/.lock", j->s->folder) < 0) return err_set(e, "out of memory");
    j->lock_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    int bad = 0;
    if (j->lock_fd < 0) bad = err_errno(e, "%s", path);
    else if (flock(j->lock_fd, LOCK_EX | LOCK_NB) != 0) {
        long pid = leftover_owner(j->lock_fd);
        if (pid > 0)
            bad = err_set(e,
                          "%s: the session is in use by another stagectl, process %ld: let it end, or "
                          "interrupt it (kill -INT %ld)",
                          j->s->folder, pid, pid);
        else
            bad = err_set(e, "%s: the session is in use by another stagectl (fuser %s names it)",
                          j->s->folder, path);
    } else {
        const long self = (long)getpid();
        if (ftruncate(j->lock_fd, 0) != 0 || dprintf(j->lock_fd, "%ld\n", self) < 0) {
        } /* only a help for whoever is kept out */
    }
    free(path);
    return bad;
}

int journal_open(journal **out, const session *s, int mode, errmsg *e)
{
    journal *j = calloc(1, sizeof *j);
    off_t whole = 0;
    const int readonly = mode == JOURNAL_READ;
    if (!j) return err_set(e, "out of memory");
    j->s = s;
    j->readonly = readonly;
    j->fd = j->lock_fd = j->ahead[0] = -1;
    j->place = calloc((size_t)s->nodes[0] * (size_t)s->nodes[1], sizeof *j->place);
    int bad = !j->place || asprintf(&j->path, "%s/journal", s->folder) < 0 ? err_set(e, "out of memory") : 0;
    if (!bad && !readonly) bad = lock_folder(j, e);
    if (!bad && !readonly && access(j->path, F_OK) != 0) bad = create(j, e);
    if (!bad) {
        j->fd = open(j->path, (readonly ? O_RDONLY : O_RDWR | O_APPEND) | O_CLOEXEC);
        bad = j->fd < 0 ? err_errno(e, "%s", j->path) : read_all(j, &whole, e);
    }
    if (!bad && j->dropped && !readonly && (ftruncate(j->fd, whole) != 0 || fdatasync(j->fd) != 0))
        bad = err_errno(e, "%s", j->path);
    j->length = whole;
    if (!bad && j->changed && mode != JOURNAL_ANEW) bad = err_set(e, "%s", j->why.text);
    if (bad) {
        journal_close(j);
        return -1;
    }
    *out = j;
    return 0;
}

void journal_close(journal *j)
{
    if (!j) return;
    size_t n = j->place ? (size_t)j->s->nodes[0] * (size_t)j->s->nodes[1] : 0;
    for (size_t p = 0; p < n; p++) {
        for (int k = 0; j->place[p].shot && k < j->s->exposures; k++) free(j->place[p].shot[k].beside);
        free(j->place[p].shot);
    }
    journal_forget_ahead(j);
    free(j->place);
    if (j->fd >= 0) close(j->fd);
    if (j->lock_fd >= 0) close(j->lock_fd);
    depends_free(&j->seen);
    free(j->path);
    free(j);
}

int journal_sync(journal *j, errmsg *e)
{
    /* the files first: a record must not outlive what it speaks of */
    if (syncfs(j->lock_fd) != 0 || fdatasync(j->fd) != 0) return err_errno(e, "%s", j->path);
    return 0;
}

/* ---- writing --------------------------------------------------------------------------------- */

int journal_run(journal *j, errmsg *e)
{
    return journal_append(j, e, "run %lld", (long long)time(NULL));
}

int journal_set_steps(journal *j, const double steps[2], errmsg *e)
{
    memcpy(j->steps, steps, sizeof j->steps);
    j->has_steps = 1;
    return journal_append(j, e, "steps %.17g %.17g", steps[0], steps[1]);
}

int journal_begin(journal *j, int i, int jj, errmsg *e)
{
    journal_at(j, i, jj)->begun = 1;
    return journal_append(j, e, "begin %d %d", i, jj);
}

int journal_arrived(journal *j, int i, int jj, const double xy[2], errmsg *e)
{
    journal_place *p = journal_at(j, i, jj);
    memcpy(p->arrived, xy, sizeof p->arrived);
    memcpy(j->last, xy, sizeof j->last);
    p->has_arrived = j->has_last = 1;
    return journal_append(j, e, "arrived %d %d %.6f %.6f", i, jj, xy[0], xy[1]);
}

int journal_stopped(journal *j, const double xy[2], errmsg *e)
{
    memcpy(j->last, xy, sizeof j->last);
    j->has_last = 1;
    return journal_append(j, e, "stopped %.6f %.6f", xy[0], xy[1]);
}

int journal_done(journal *j, int i, int jj, errmsg *e)
{
    journal_at(j, i, jj)->done = 1;
    return journal_append(j, e, "done %d %d", i, jj);
}

int journal_check(journal *j, int i, int jj, int k, const double f[4], errmsg *e)
{
    return journal_append(j, e, "check %d %d %d %.4g %.4g %.3f %.3f", i, jj, k, f[0], f[1], f[2], f[3]);
}
