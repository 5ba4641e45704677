/* positions.c - see positions.h. */
#include "positions.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/outfile.h"
#include "files.h"

enum { COARSE = 4 };

int positions_adaptive(const session *s)
{
    return !strcmp(s->positions, "adaptive");
}

long positions_most(const session *s)
{
    const long all = (long)s->nodes[0] * s->nodes[1];
    const long most = s->positions_most > 0 ? s->positions_most : (5 * all + 7) / 8;
    return most < all ? most : all;
}

int positions_path(char path[4096], const session *s, errmsg *e)
{
    if (positions_adaptive(s)) return files_join(path, 4096, s->folder, "positions.txt", e);
    const int whole = s->positions[0] == '/';
    const int n = snprintf(path, 4096, "%s%s", whole ? "" : s->home_folder, s->positions);
    return n < 4096 ? 0 : err_set(e, "%s: too long a name", s->positions);
}

/* ---- the list in memory ----------------------------------------------------------------------------- */

static int begin_list(session *s, errmsg *e)
{
    free(s->listed);
    s->n_listed = 0;
    s->listed = calloc((size_t)s->nodes[0] * (size_t)s->nodes[1], sizeof *s->listed);
    return s->listed ? 0 : err_set(e, "out of memory");
}

static void put(session *s, int i, int j)
{
    s->listed[s->n_listed][0] = i;
    s->listed[s->n_listed++][1] = j;
}

/* The kth of `of` nodes spread over n. */
static int spread(int k, int of, int n)
{
    return of > 1 ? (int)lround((double)k * (n - 1) / (of - 1)) : 0;
}

/* Row by row, to and fro. */
static void coarse(session *s)
{
    const int nu = s->nodes[0] < COARSE ? s->nodes[0] : COARSE,
              nv = s->nodes[1] < COARSE ? s->nodes[1] : COARSE;
    for (int j = 0; j < nv; j++)
        for (int i = 0; i < nu; i++)
            put(s, spread(j % 2 ? nu - 1 - i : i, nu, s->nodes[0]), spread(j, nv, s->nodes[1]));
}

/* One line: 0 also for a comment. */
static int take_line(session *s, char *seen, const char *line, const char *path, int number, errmsg *e)
{
    int i, j, at = 0;
    const char *p = line + strspn(line, " \t");
    if (!*p || *p == '#') return 0;
    if (sscanf(p, "%d %d %n", &i, &j, &at) != 2 || p[at])
        return err_set(e, "%s: line %d: expected \"I J\", a node of the grid, found '%.80s'", path, number,
                       p);
    if (i < 0 || j < 0 || i >= s->nodes[0] || j >= s->nodes[1])
        return err_set(e, "%s: line %d: expected a node of %dx%d, found %d %d", path, number, s->nodes[0],
                       s->nodes[1], i, j);
    char *was = &seen[(size_t)i + (size_t)j * (size_t)s->nodes[0]];
    if (*was)
        return err_set(e, "%s: line %d: expected each node once, found %d %d again", path, number, i, j);
    *was = 1;
    put(s, i, j);
    return 0;
}

static int read_list(session *s, FILE *f, const char *path, errmsg *e)
{
    char line[512], *seen = calloc((size_t)s->nodes[0] * (size_t)s->nodes[1], 1);
    int number = 0, bad = seen ? 0 : err_set(e, "out of memory");
    while (!bad && fgets(line, sizeof line, f)) {
        number++;
        if (!strchr(line, '\n') && !feof(f))
            bad = err_set(e, "%s: line %d: expected a shorter one", path, number);
        line[strcspn(line, "\r\n")] = 0;
        if (!bad) bad = take_line(s, seen, line, path, number, e);
    }
    if (!bad && ferror(f)) bad = err_errno(e, "%s", path);
    if (!bad && s->n_listed == 0) bad = err_set(e, "%s: expected lines \"I J\", found none", path);
    free(seen);
    return bad;
}

int positions_load(session *s, errmsg *e)
{
    char path[4096];
    if (!strcmp(s->positions, "all")) return 0;
    if (!s->positions[0]) return err_set(e, "[grid] positions: expected all, adaptive or the name of a list");
    if (positions_path(path, s, e) != 0 || begin_list(s, e) != 0) return -1;
    FILE *f = fopen(path, "r");
    if (!f && positions_adaptive(s) && errno == ENOENT) return coarse(s), 0;
    if (!f) return err_errno(e, "%s", path);
    int bad = read_list(s, f, path, e);
    fclose(f);
    return bad;
}

/* ---- on disk ---------------------------------------------------------------------------------------- */

int positions_begin(const session *s, errmsg *e)
{
    char path[4096];
    outfile *o;
    if (!positions_adaptive(s)) return 0;
    if (positions_path(path, s, e) != 0) return -1;
    if (access(path, F_OK) == 0) return 0;
    if (out_begin(&o, path, e) != 0) return -1;
    fprintf(out_stream(o), "# nodes of %dx%d to visit: I J; a coarse grid first\n", s->nodes[0], s->nodes[1]);
    for (long k = 0; k < s->n_listed; k++)
        fprintf(out_stream(o), "%d %d\n", s->listed[k][0], s->listed[k][1]);
    return out_commit(o, e);
}

int positions_anew(session *s, errmsg *e)
{
    char path[4096];
    if (!positions_adaptive(s)) return 0;
    if (positions_path(path, s, e) != 0) return -1;
    if (remove(path) != 0 && errno != ENOENT) return err_errno(e, "%s", path);
    return positions_load(s, e);
}
