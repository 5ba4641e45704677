/*
 * positions.c - see positions.h.
 */
#include "positions.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/textfile.h"

enum { MOST_LINE = 4096, LEAST_NUMBERS = 3 };

static int read_line(place *p, char *line, int number, const char *path, errmsg *e)
{
    const char *rest;
    char *name;
    const int n = place_of_line(p, &name, line, &rest);

    if (n < LEAST_NUMBERS)
        return err_set(e,
                       "%s: line %d: expected \"picture x y z heading [pitch roll]\", found \"%.60s%s%.60s\"",
                       path, number, line, name ? " " : "", name ? rest : "");
    p->name = strdup(name);
    if (!p->name) return err_set(e, "%s: no memory for its lines", path);
    p->line = number;
    return 0;
}

static int add(places *all, const place *p)
{
    place *more = realloc(all->p, (size_t)(all->n + 1) * sizeof *more);

    if (!more) return -1;
    all->p = more;
    all->p[all->n++] = *p;
    return 0;
}

int places_read(places *all, const char *path, errmsg *e)
{
    char *text, line[MOST_LINE];
    int bad = 0;

    memset(all, 0, sizeof *all);
    if (text_read(&text, path, e)) return -1;
    textlines t = textlines_of(text);
    while (!bad && textlines_next(line, sizeof line, &t)) {
        place p;
        bad = read_line(&p, line, t.number, path, e);
        if (!bad && add(all, &p)) {
            free(p.name);
            bad = err_set(e, "%s: no memory for its lines", path);
        }
    }
    free(text);
    if (!bad && !all->n)
        bad = err_set(e, "%s: expected lines \"picture x y z heading [pitch roll]\", found none", path);
    if (bad) places_free(all);
    return bad;
}

void places_free(places *all)
{
    for (int k = 0; k < all->n; k++) free(all->p[k].name);
    free(all->p);
    memset(all, 0, sizeof *all);
}

int places_names(char ***names, const places *all, const char *path, errmsg *e)
{
    const char *slash = strrchr(path, '/');
    const int folder = slash ? (int)(slash + 1 - path) : 0;

    *names = calloc((size_t)all->n + 1, sizeof **names);
    for (int k = 0; *names && k < all->n; k++) {
        const char *name = all->p[k].name;
        const size_t room = (size_t)folder + strlen(name) + 1;
        (*names)[k] = malloc(room);
        if (!(*names)[k]) return err_set(e, "%s: no memory for its names", path);
        (void)!snprintf((*names)[k], room, "%.*s%s", *name == '/' ? 0 : folder, path, name);
    }
    return *names ? 0 : err_set(e, "%s: no memory for its names", path);
}

static const char *last_part(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? slash + 1 : path;
}

/* How well a line's name means a picture: 0 not at all, 3 the same. */
static int means(const char *name, const char *picture)
{
    const char *a = last_part(name), *b = last_part(picture);
    const size_t stem = strcspn(b, ".");

    if (strcmp(name, picture) == 0) return 3;
    if (strcmp(a, b) == 0) return 2;
    return stem > 0 && strlen(a) == stem && strncmp(a, b, stem) == 0;
}

/* The line that means a picture, from number `from` on: -1 none, -2 two do. */
static int find(const places *all, int from, const char *picture)
{
    int best = 0, which = -1;

    for (int k = from; k < all->n; k++) {
        const int m = means(all->p[k].name, picture);
        if (m > best) best = m, which = k;
        else if (m && m == best) which = -2;
    }
    return which;
}

int places_match(places *all, char *const *pictures, int n, const char *path, errmsg *e)
{
    for (int k = 0; k < n; k++) {
        const int at = find(all, k, pictures[k]);
        if (at == -1) return err_set(e, "%s: expected a line for %s, found none", path, pictures[k]);
        if (at == -2) return err_set(e, "%s: expected one line for %s, found more", path, pictures[k]);
        const place p = all->p[k];
        all->p[k] = all->p[at], all->p[at] = p;
    }
    return 0;
}
