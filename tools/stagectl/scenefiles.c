/* scenefiles.c - see scenefiles.h. */
#include "scenefiles.h"

#include <ctype.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sha256.h"

enum { LONGEST = 1024, MOST_FILES = 100000 };

typedef struct file_id {
    dev_t dev;
    ino_t ino;
} file_id;

typedef struct walk {
    sha256 h;
    file_id *seen; /* files that count already */
    size_t n_seen;
    uint64_t *word; /* hashes of words that were looked up, an open table */
    size_t n_words, room;
    const char *raypath;
    int failed; /* out of memory */
} walk;

static void add_file(walk *w, const char *path, int depth);

/* ---- words that were met before ------------------------------------------------------------------ */

static int known_word(walk *w, const char *s, size_t n)
{
    uint64_t hash = 1469598103934665603u; /* FNV-1a */
    for (size_t i = 0; i < n; i++) hash = (hash ^ (unsigned char)s[i]) * 1099511628211u;
    hash |= 1;
    if (2 * (w->n_words + 1) > w->room) {
        size_t room = w->room ? 2 * w->room : 1024;
        uint64_t *more = calloc(room, sizeof *more);
        if (!more) {
            w->failed = 1;
            return 1;
        }
        for (size_t i = 0; i < w->room; i++) {
            size_t at = w->word[i] & (room - 1);
            while (w->word[i] && more[at]) at = (at + 1) & (room - 1);
            if (w->word[i]) more[at] = w->word[i];
        }
        free(w->word);
        w->word = more;
        w->room = room;
    }
    size_t at = hash & (w->room - 1);
    while (w->word[at] && w->word[at] != hash) at = (at + 1) & (w->room - 1);
    if (w->word[at]) return 1;
    w->word[at] = hash;
    w->n_words++;
    return 0;
}

/* ---- from a word to its file ----------------------------------------------------------------------- */

/* Half of all words in a scene are numbers. */
static int is_number(const char *s, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isdigit((unsigned char)s[i]) && !strchr("+-.eE", s[i])) return 0;
    return 1;
}

static int is_file(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

/* As Radiance's getpath: the current folder, then RAYPATH for names that don't begin at a place of their own.
 */
static void look_up(walk *w, const char *s, size_t n, int depth)
{
    char name[LONGEST + 1], path[2 * LONGEST + 2];
    if (n < 2 || n > LONGEST || is_number(s, n) || known_word(w, s, n)) return;
    memcpy(name, s, n);
    name[n] = 0;
    if (is_file(name)) {
        add_file(w, name, depth);
        return;
    }
    if (name[0] == '/' || name[0] == '.') return;
    for (const char *p = w->raypath; p && *p;) {
        size_t len = strcspn(p, ":");
        if (len > 0 && len <= LONGEST) {
            memcpy(path, p, len);
            path[len] = '/';
            memcpy(path + len + 1, name, n + 1);
            if (is_file(path)) {
                add_file(w, path, depth);
                return;
            }
        }
        p += len + (p[len] == ':');
    }
}

/* ---- the words of a file --------------------------------------------------------------------------- */

static int has_zero(const char *text, size_t n)
{
    return memchr(text, 0, n < 65536 ? n : 65536) != NULL;
}

/* Scene and function files: what stands between blanks and quotes; # to the line's end is a remark, but not
 * within a command's line. */
static void words_of_text(walk *w, const char *p, size_t n, int depth)
{
    static const char between[] = " \t\r\n\"'`;|<>()=,";
    const char *end = p + n;
    int command = 0, fresh = 1;
    while (p < end) {
        if (fresh) command = *p == '!';
        fresh = 0;
        if (*p == '#' && !command) {
            while (p < end && *p != '\n') p++;
        } else if (*p == '\n' || strchr(between, *p) || (*p == '!' && command)) {
            fresh = *p == '\n' && (p[-1] != '\\' || !command);
            p++;
        } else {
            const char *from = p;
            while (p < end && !strchr(between, *p)) p++;
            look_up(w, from, (size_t)(p - from), depth);
        }
    }
}

/* Octrees and meshes hold their strings ended by a zero, among numbers in binary: a printable byte before may
 * be a number's. */
static void words_of_binary(walk *w, const char *p, size_t n, int depth)
{
    size_t from = 0;
    for (size_t i = 0; i < n; i++) {
        if (isprint((unsigned char)p[i])) continue;
        if (p[i] == 0 && i - from >= 2) {
            look_up(w, p + from, i - from, depth);
            look_up(w, p + from + 1, i - from - 1, depth);
        }
        from = i + 1;
    }
}

/* "#?RADIANCE" and a FORMAT line: octrees and meshes name files, pictures don't. */
static int names_files(const char *text, size_t n)
{
    size_t head = n < 65536 ? n : 65536;
    if (n < 10 || memcmp(text, "#?RADIANCE", 10) != 0) return 0;
    return memmem(text, head, "FORMAT=Radiance_octree", 22) ||
           memmem(text, head, "FORMAT=Radiance_tmesh", 21);
}

static void add_file(walk *w, const char *path, int depth)
{
    struct stat st;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return;
    if (fstat(fd, &st) != 0 || w->n_seen >= MOST_FILES) {
        close(fd);
        return;
    }
    for (size_t i = 0; i < w->n_seen; i++)
        if (w->seen[i].dev == st.st_dev && w->seen[i].ino == st.st_ino) {
            close(fd);
            return;
        }
    if ((w->n_seen & (w->n_seen - 1)) == 0) { /* the room doubles */
        file_id *more = realloc(w->seen, (w->n_seen ? 2 * w->n_seen : 1) * sizeof *more);
        if (!more) {
            w->failed = 1;
            close(fd);
            return;
        }
        w->seen = more;
    }
    w->seen[w->n_seen++] = (file_id){st.st_dev, st.st_ino};
    size_t n = (size_t)st.st_size;
    char *text = n ? mmap(NULL, n, PROT_READ, MAP_PRIVATE, fd, 0) : NULL;
    close(fd);
    if (n && text == MAP_FAILED) {
        w->failed = 1;
        return;
    }
    sha256_add(&w->h, &st.st_size, sizeof st.st_size); /* where one file ends and the next begins */
    if (!n) return;
    sha256_add(&w->h, text, n);
    if (depth < 64) {
        if (names_files(text, n)) words_of_binary(w, text, n, depth + 1);
        else if (!has_zero(text, n)) words_of_text(w, text, n, depth + 1);
    }
    munmap(text, n);
}

int scene_digest(char hex[65], const char *path, errmsg *e)
{
    walk w = {.raypath = getenv("RAYPATH")};
    struct stat st;
    int fd = open(path, O_RDONLY | O_CLOEXEC), bad = 0;
    if (fd < 0 || fstat(fd, &st) != 0) bad = err_errno(e, "%s", path);
    else if (!S_ISREG(st.st_mode)) bad = err_set(e, "%s: expected a file", path);
    if (fd >= 0) close(fd);
    if (bad) return -1;
    sha256_begin(&w.h);
    add_file(&w, path, 0);
    errmsg why;
    w.failed |= sha256_end(&w.h, hex, &why) != 0;
    free(w.seen);
    free(w.word);
    return w.failed ? err_set(e, "%s: can't be read whole (out of memory?)", path) : 0;
}
