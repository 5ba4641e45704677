/*
 * image_exr_choose.c - which part, layer and view of an OpenEXR file is the picture.
 *
 * A picture is what has channels R, G and B, or Y (grey), or Y, RY and BY (luminance and chroma).  "L.R" is
 * layer L's red; with the attribute multiView a view's name may stand before the last point, the first view
 * named there being the default, whose names go without it.  Parts have an attribute "view" instead.
 *
 * Taken is what has no layer's name, before named layers; the default view before others; colour before grey.
 * If that leaves several, only one that is called what programs call the picture itself is taken.  What was
 * chosen among several is said; where nothing decides, we refuse and name them.
 */
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "image_exr.h"

enum { MOST = 256 }; /* candidates */

typedef struct candidate {
    int part, luma, n; /* n channels, alpha included */
    int view;          /* 1: another view than the default one */
    int label;         /* of the layer: bytes of the first channel's name before its last point, 0: none */
    const char *first; /* that name */
    const char *name[EXR_PICKED];
} candidate;

/* ---- names -------------------------------------------------------------------------------------------- */

static int prefix_of(const char *channel)
{
    const char *dot = strrchr(channel, '.');
    return dot ? (int)(dot - channel) : 0;
}

static const char *last_of(const char *channel)
{
    const char *dot = strrchr(channel, '.');
    return dot ? dot + 1 : channel;
}

/* Channel of the layer that first begins with; a name in capitals, else small, else written out. */
static const exr_channel *find(const exr_part *p, const char *first, int prefix, const char *name,
                               const char *word)
{
    const exr_channel *best = NULL;
    int rank = 3;
    for (int k = 0; k < p->channels; k++) {
        const char *c = p->channel[k].name, *last = last_of(c);
        if (prefix_of(c) != prefix || strncmp(c, first, (size_t)prefix) != 0) continue;
        int is = strcmp(last, name) == 0       ? 0
                 : strcasecmp(last, name) == 0 ? 1
                 : strcasecmp(last, word) == 0 ? 2
                                               : 3;
        if (is < rank) best = &p->channel[k], rank = is;
    }
    return best;
}

/* Is the layer another view than the default one, by the attribute multiView? */
static int other_view(const exr_part *p, const char *first, int prefix)
{
    int from = prefix;
    while (from > 0 && first[from - 1] != '.') from--;
    for (int k = 1; prefix > 0 && k < p->nviews; k++)
        if ((int)strlen(p->views[k]) == prefix - from &&
            strncmp(p->views[k], first + from, (size_t)(prefix - from)) == 0)
            return 1;
    return 0;
}

/* ---- candidates -----------------------------------------------------------------------------------------
 */

static int colours(candidate *c, const exr_part *p, const char *first, int prefix)
{
    const exr_channel *rgb[3] = {find(p, first, prefix, "R", "red"), find(p, first, prefix, "G", "green"),
                                 find(p, first, prefix, "B", "blue")};
    const exr_channel *y = find(p, first, prefix, "Y", "Y"), *a = find(p, first, prefix, "A", "alpha");
    const exr_channel *ry = find(p, first, prefix, "RY", "RY"), *by = find(p, first, prefix, "BY", "BY");
    *c = (candidate){.first = first, .label = prefix};
    if (rgb[0] && rgb[1] && rgb[2]) {
        for (; c->n < 3; c->n++) c->name[c->n] = rgb[c->n]->name;
    } else if (y && ry && by) {
        c->luma = 1;
        c->name[0] = y->name;
        c->n = 3;
    } else if (y && !ry && !by) {
        c->name[c->n++] = y->name;
    } else {
        return 0;
    }
    if (a) {
        if (!c->luma) c->name[c->n] = a->name;
        c->n++;
    }
    return 1;
}

/* Mattes of object names (Cryptomatte) have channels r, g, b and are no light. */
static int is_matte(const char *first, int prefix)
{
    for (int k = 0; k + 6 <= prefix; k++)
        if (strncasecmp(first + k, "crypto", 6) == 0) return 1;
    return 0;
}

static int list_candidates(candidate *list, const exr_file *f)
{
    int n = 0;
    for (int part = 0; part < exr_file_parts(f); part++) {
        const exr_part *p = exr_file_part(f, part);
        for (int k = 0; k < p->channels && !p->deep; k++) {
            const char *first = p->channel[k].name;
            int prefix = prefix_of(first), seen = 0;
            for (int j = 0; j < k && !seen; j++)
                seen = prefix_of(p->channel[j].name) == prefix &&
                       strncmp(p->channel[j].name, first, (size_t)prefix) == 0;
            if (seen || n == MOST || !colours(&list[n], p, first, prefix) || is_matte(first, prefix))
                continue;
            list[n].part = part;
            list[n].view = other_view(p, first, prefix);
            n++;
        }
    }
    const char *hero = ""; /* of parts with views, the first picture's is the default */
    for (int k = 0; k < n && !*hero; k++) hero = exr_file_part(f, list[k].part)->view;
    for (int k = 0; k < n; k++) {
        const char *view = exr_file_part(f, list[k].part)->view;
        if (*view && strcmp(view, hero) != 0) list[k].view = 1;
    }
    return n;
}

/* PART:LAYER, PART or LAYER, for people; of what has no name in a file of one part, the default view. */
static void describe(char *to, size_t room, const candidate *c, const exr_file *f)
{
    const exr_part *p = exr_file_part(f, c->part);
    const char *part = exr_file_parts(f) < 2 ? "" : *p->name ? p->name : "(a part without a name)";
    if (!*part && !c->label) snprintf(to, room, "%s", p->nviews ? p->views[0] : "(without a name)");
    else snprintf(to, room, "%s%s%.*s", part, *part && c->label ? ":" : "", c->label, c->first);
}

static void describe_all(char *to, size_t room, const candidate *list, int n, const exr_file *f)
{
    to[0] = 0;
    for (int k = 0; k < n && strlen(to) + 8 < room; k++) {
        char one[2 * EXR_NAME];
        describe(one, sizeof one, &list[k], f);
        snprintf(to + strlen(to), room - strlen(to), "%s%.60s", k ? ", " : "", one);
    }
}

/* ---- choosing -------------------------------------------------------------------------------------------
 */

/* Keep those for which want holds, if there are any; returns how many are left. */
static int keep_if(candidate *list, int n, int (*want)(const candidate *))
{
    int m = 0;
    for (int k = 0; k < n; k++) m += want(&list[k]) != 0;
    if (m == 0) return n;
    m = 0;
    for (int k = 0; k < n; k++)
        if (want(&list[k])) list[m++] = list[k];
    return m;
}

static int default_view(const candidate *c)
{
    return !c->view;
}

static int without_layer(const candidate *c)
{
    return c->label == 0;
}

static int in_colour(const candidate *c)
{
    return c->n >= 3;
}

/* What programs call the picture itself among its passes. */
static int called_picture(const char *name, int n)
{
    static const char *const names[] = {"combined", "beauty", "rgba", "rgb"};
    while (n > 0 && memchr(name, '.', (size_t)n)) name++, n--; /* the last of a.b.c */
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if ((int)strlen(names[k]) == n && strncasecmp(name, names[k], (size_t)n) == 0) return 1;
    return 0;
}

static int keep_called_picture(candidate *list, int n, const exr_file *f)
{
    int at = -1;
    for (int k = 0; k < n; k++) {
        const char *part = exr_file_part(f, list[k].part)->name;
        int is = list[k].label ? called_picture(list[k].first, list[k].label)
                               : called_picture(part, (int)strlen(part));
        if (is && at >= 0) return n;
        if (is) at = k;
    }
    if (at < 0) return n;
    list[0] = list[at];
    return 1;
}

/* Does the user's name mean this one: its layer, its part, its view, or PART:LAYER as we call it? */
static int is_named(const candidate *c, const char *layer, const exr_file *f)
{
    const exr_part *p = exr_file_part(f, c->part);
    char ours[2 * EXR_NAME];
    describe(ours, sizeof ours, c, f);
    return ((int)strlen(layer) == c->label && strncmp(layer, c->first, (size_t)c->label) == 0) ||
           strcmp(layer, p->name) == 0 || (*p->view && strcmp(layer, p->view) == 0) ||
           strcmp(layer, ours) == 0;
}

/* A single channel by its full name is a grey picture. */
static int single_channel(candidate *c, const exr_file *f, const char *name)
{
    for (int part = 0; part < exr_file_parts(f); part++) {
        const exr_part *p = exr_file_part(f, part);
        for (int k = 0; k < p->channels && !p->deep; k++)
            if (strcmp(p->channel[k].name, name) == 0) {
                *c = (candidate){
                    .part = part, .n = 1, .first = p->channel[k].name, .name = {p->channel[k].name}};
                return 1;
            }
    }
    return 0;
}

static int no_picture(const exr_file *f, const img_reader *r, errmsg *e)
{
    char names[300] = "";
    int deep = 1;
    for (int part = 0; part < exr_file_parts(f); part++) {
        const exr_part *p = exr_file_part(f, part);
        deep = deep && p->deep;
        for (int k = 0; k < p->channels && strlen(names) < 240; k++)
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%.40s", *names ? ", " : "",
                     p->channel[k].name);
    }
    if (deep) return img_bad(r, e, "expected an OpenEXR picture, found deep data");
    return img_bad(r, e, "expected channels R, G, B or Y, found %s", *names ? names : "none");
}

static int choose(candidate *list, int n, int *said, const exr_file *f, const char *layer,
                  const img_reader *r, errmsg *e)
{
    char words[400];
    *said = 0;
    if (layer) {
        int m = 0;
        describe_all(words, sizeof words, list, n, f);
        for (int k = 0; k < n; k++)
            if (is_named(&list[k], layer, f)) list[m++] = list[k];
        if (m == 0 && !single_channel(&list[m++], f, layer))
            return img_bad(r, e, "no layer, part, view or channel is called '%.60s'; it has %s", layer,
                           *words ? words : "none");
        n = m;
    }
    if (n == 0) return no_picture(f, r, e);
    int all = n;
    n = keep_if(list, n, default_view);
    *said = n < all;
    n = keep_if(list, n, without_layer);
    n = keep_if(list, n, in_colour);
    if (list[0].label && !layer) *said = 1;
    if (n > 1) n = keep_called_picture(list, n, f), *said = 1;
    if (n == 1) return 0;
    describe_all(words, sizeof words, list, n, f);
    return img_bad(r, e, "expected one picture, found %d: %s; name the one to take (a layer)", n, words);
}

int exr_choose(exr_choice *c, const exr_file *f, const char *layer, const img_reader *r, errmsg *e)
{
    candidate *list = calloc(MOST + 1, sizeof *list);
    int said = 0;
    if (!list) return img_bad(r, e, "out of memory");
    int n = list_candidates(list, f), rc = choose(list, n, &said, f, layer, r, e);
    if (rc == 0) {
        char what[2 * EXR_NAME];
        *c = (exr_choice){.part = list->part, .n = list->n, .luma = list->luma};
        for (int k = 0; k < EXR_PICKED && list->name[k]; k++)
            snprintf(c->name[k], EXR_NAME, "%s", list->name[k]);
        if (c->luma) snprintf(c->name[0], EXR_NAME, "%.*s", list->label, list->first);
        describe(what, sizeof what, list, f);
        const char *view = exr_file_part(f, c->part)->view;
        if (said && !layer)
            snprintf(c->said, sizeof c->said, "taken as the picture: %s %.200s%s%.60s",
                     exr_file_parts(f) > 1 ? "part"
                     : list->label         ? "layer"
                                           : "view",
                     what, *view ? ", view " : "", view);
    }
    free(list);
    return rc;
}
