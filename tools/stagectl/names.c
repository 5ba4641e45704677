/* names.c - see names.h. */
#include "names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "camerawords.h"
#include "template.h"

/* Plain names below the folder: nothing hidden, nothing that leads out. */
static int inside(const char *name, errmsg *e)
{
    size_t n = strlen(name);
    int bad = name[0] == '/' || n == 0 || name[n - 1] == '/';
    for (const char *p = name; *p; p++) {
        bad |= (p == name || p[-1] == '/') && (*p == '.' || *p == '/');
        bad |= (unsigned char)*p < 0x20 || *p == '"';
    }
    return bad ? err_set(e,
                         "expected a name below the folder, no part of it empty or beginning with a dot, "
                         "found '%s'",
                         name)
               : 0;
}

int name_picture(char out[NAME_ROOM], const session *s, int i, int j, int k, errmsg *e)
{
    const template_var v[] = {{"i", NULL, i}, {"j", NULL, j}, {"k", NULL, k}, {0}};
    return template_expand(out, NAME_ROOM, s->file, v, e) || inside(out, e) ? -1 : 0;
}

int name_stem(const char *name)
{
    const char *dot = strrchr(name, '.');
    return dot && dot > name && !strchr(dot, '/') && strlen(dot) < 12 ? (int)(dot - name) : (int)strlen(name);
}

int name_times(char out[NAME_ROOM], const session *s, int i, int j, errmsg *e)
{
    const template_var v[] = {{"i", NULL, i}, {"j", NULL, j}, {0}};
    out[0] = 0;
    if (!s->times[0]) return 0;
    return template_expand(out, NAME_ROOM, s->times, v, e) || inside(out, e) ? -1 : 0;
}

static void number(char out[40], double v)
{
    snprintf(out, 40, "%.10g", v + 0.0);
}

/* Words as one command line for sh: each value in single quotes. */
static int quote(char *out, size_t room, const char *s)
{
    size_t n = 0;
    if (room < 3) return -1;
    out[n++] = '\'';
    for (; *s; s++) {
        if (n + 8 > room) return -1;
        if (*s == '\'') {
            memcpy(out + n, "'\\''", 4);
            n += 4;
        } else out[n++] = *s;
    }
    out[n++] = '\'';
    out[n] = 0;
    return 0;
}

/* What the braces stand for in one exposure's command. */
typedef struct values {
    char x[8][40], plane[256], file[2 * NAME_ROOM + 4096], stem[2 * NAME_ROOM + 4096];
    argwords labels;
    template_var v[20];
} values;

/* file NULL: not there.  quoted: as words of a command line for sh. */
static int values_of(values *u, const session *s, const place *p, const double arrived[2], int k,
                     const char *file, int quoted, errmsg *e)
{
    double measured[2];
    char stem[4096];
    plan_on_plane(measured, s, arrived);
    const double number_of[8] = {
        p->plane[0], p->plane[1], measured[0],    measured[1],
        arrived[0],  arrived[1],  s->exposure[k], s->fov > 0 ? s->fov : camera_default_fov};
    for (int q = 0; q < 8; q++) number(u->x[q], number_of[q]);
    plane_text(u->plane, s->plane);
    u->labels = (argwords){0};
    const int n = file ? snprintf(stem, sizeof stem, "%.*s", name_stem(file), file) : 0;
    if (n < 0 || n >= (int)sizeof stem) return err_set(e, "%s: the name is too long", file);
    if (file && quoted &&
        (quote(u->file, sizeof u->file, file) != 0 || quote(u->stem, sizeof u->stem, stem) != 0))
        return err_set(e, "%s: the name is too long", file);
    if (argwords_split(&u->labels, s->labels, e) != 0) return -1;
    const template_var v[] = {{"label", u->labels.n > k ? u->labels.word[k] : "", 0},
                              {"seconds", u->x[6], 0},
                              {"x", u->x[0], 0},
                              {"y", u->x[1], 0},
                              {"ax", u->x[2], 0},
                              {"ay", u->x[3], 0},
                              {"mx", u->x[4], 0},
                              {"my", u->x[5], 0},
                              {"plane", u->plane, 0},
                              {"lens", s->lens[0] ? s->lens : camera_default_lens, 0},
                              {"fov", u->x[7], 0},
                              {"i", NULL, p->i},
                              {"j", NULL, p->j},
                              {"k", NULL, k},
                              {file ? "file" : NULL, quoted ? u->file : file, 0},
                              {"stem", u->stem, 0},
                              {0}};
    if (file && !quoted) memcpy(u->stem, stem, (size_t)n + 1);
    memcpy(u->v, v, sizeof v);
    return 0;
}

int name_text(char out[WORD_ROOM], const session *s, const char *text, const place *p,
              const double arrived[2], int k, errmsg *e)
{
    values *u = malloc(sizeof *u);
    if (!u) return err_set(e, "out of memory");
    int bad = values_of(u, s, p, arrived, k, NULL, 0, e);
    if (!bad) bad = template_expand(out, WORD_ROOM, text, u->v, e);
    argwords_free(&u->labels);
    free(u);
    return bad;
}

int name_command(argwords *argv, const session *s, const place *p, const double arrived[2], int k,
                 const char *file, errmsg *e)
{
    char *word = malloc(WORD_ROOM);
    values *u = calloc(1, sizeof *u);
    argwords given, whole = {.n = 1};
    char *one[2] = {s->command, NULL};
    int bad = word && u ? values_of(u, s, p, arrived, k, file, s->shell, e) : err_set(e, "out of memory");
    const template_var *v = u ? u->v : NULL;
    whole.word = one;
    argwords split = {0};
    if (!bad && !s->shell) bad = argwords_split(&split, s->command, e);
    given = s->shell ? whole : split;
    /* first the lengths, then the words: they move in one block as argwords has it */
    size_t bytes = 0, lead = s->shell ? 2 : 0;
    for (int w = 0; w < given.n && !bad; w++) {
        bad = template_expand(word, WORD_ROOM, given.word[w], v, e);
        if (!bad) bytes += strlen(word) + 1;
    }
    if (!bad) {
        size_t pointers = ((size_t)given.n + lead + 1) * sizeof(char *);
        char **all = calloc(1, pointers + bytes + 16);
        if (!all) bad = err_set(e, "out of memory");
        else {
            char *to = (char *)all + pointers;
            int n = 0;
            if (s->shell) {
                all[n++] = strcpy(to, "sh");
                all[n++] = strcpy(to + 3, "-c");
                to += 6;
            }
            for (int w = 0; w < given.n; w++) {
                template_expand(word, WORD_ROOM, given.word[w], v, e);
                all[n++] = strcpy(to, word);
                to += strlen(word) + 1;
            }
            argv->n = n;
            argv->word = all;
        }
    }
    argwords_free(&split);
    if (u) argwords_free(&u->labels);
    free(u);
    free(word);
    return bad;
}

int names_check(const session *s, errmsg *e)
{
    char first[NAME_ROOM], other[NAME_ROOM];
    const int n = s->nodes[0] - 1, m = s->nodes[1] - 1, last = s->exposures - 1;
    const int node[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double at[2] = {0, 0};
    argwords argv;
    place p;
    if (name_picture(first, s, 0, 0, 0, e) != 0) return -1;
    for (int t = 0; t < 3; t++) {
        if ((t == 0 ? n : t == 1 ? m : last) == 0) continue;
        if (name_picture(other, s, node[t][0], node[t][1], node[t][2], e) != 0) return -1;
        if (!strcmp(first, other))
            return err_set(e, "[output] file: expected {%c} in '%s': pictures would replace each other",
                           "ijk"[t], s -> file);
    }
    if (name_picture(other, s, n, m, last, e) != 0 || name_times(first, s, 0, 0, e) != 0) return -1;
    for (int t = 0; t < 2 && first[0]; t++) {
        if ((t == 0 ? n : m) == 0) continue;
        if (name_times(other, s, node[t][0], node[t][1], e) != 0) return -1;
        if (!strcmp(first, other))
            return err_set(e, "[output] times: expected {%c} in '%s'", "ij"[t], s -> times);
    }
    plan_place(&p, s, 0);
    if (name_command(&argv, s, &p, at, 0, "file", e) != 0) return -1;
    argwords_free(&argv);
    char *text = malloc(WORD_ROOM);
    int bad = text ? name_text(text, s, s->expect_text, &p, at, 0, e) : err_set(e, "out of memory");
    free(text);
    return bad;
}
