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
        } else
            out[n++] = *s;
    }
    out[n++] = '\'';
    out[n] = 0;
    return 0;
}

int name_command(argwords *argv, const session *s, const place *p, const double arrived[2], int k,
                 const char *file, errmsg *e)
{
    char x[8][40], plane[256], quoted[2 * NAME_ROOM + 4096], *word = malloc(WORD_ROOM);
    double measured[2];
    argwords given, whole = {.n = 1};
    char *one[2] = {s->command, NULL};
    plan_on_plane(measured, s, arrived);
    number(x[0], p->plane[0]);
    number(x[1], p->plane[1]);
    number(x[2], measured[0]);
    number(x[3], measured[1]);
    number(x[4], arrived[0]);
    number(x[5], arrived[1]);
    number(x[6], s->exposure[k]);
    number(x[7], s->fov > 0 ? s->fov : camera_default_fov);
    plane_text(plane, s->plane);
    int bad = word ? 0 : err_set(e, "out of memory");
    if (!bad && s->shell && quote(quoted, sizeof quoted, file) != 0)
        bad = err_set(e, "%s: the name is too long", file);
    argwords labels = {0};
    if (!bad) bad = argwords_split(&labels, s->labels, e);
    const template_var v[] = {{"label", labels.n > k ? labels.word[k] : "", 0},
                              {"file", s->shell ? quoted : file, 0},
                              {"seconds", x[6], 0},
                              {"x", x[0], 0},
                              {"y", x[1], 0},
                              {"ax", x[2], 0},
                              {"ay", x[3], 0},
                              {"mx", x[4], 0},
                              {"my", x[5], 0},
                              {"plane", plane, 0},
                              {"lens", s->lens[0] ? s->lens : camera_default_lens, 0},
                              {"fov", x[7], 0},
                              {"i", NULL, p->i},
                              {"j", NULL, p->j},
                              {"k", NULL, k},
                              {0}};
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
        if (!all)
            bad = err_set(e, "out of memory");
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
    argwords_free(&labels);
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
    return 0;
}
