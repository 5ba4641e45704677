/*
 * headings.c - see headings.h.
 */
#include "headings.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/blobs.h"
#include "ilflamps/lm.h"
#include "ilflamps/vec.h"
#include "shots.h"

enum { ACROSS = 41, UP = 24, FEWEST = 4 };
#define OVER    15. /* bright: times the picture's median luminance */
#define WIDTH   6.  /* sizes of the plane to each side in which a lamp is looked for, */
#define LOWEST  .3  /* and its heights */
#define HIGHEST 8.
#define OFF     .05  /* radians: a spot whose elevation is more off is not the lamp's */
#define ALIKE   .3   /* log: as much as a lamp's light may differ between pictures */
#define MEET    .012 /* rms of the elevations' misfit that is no lamp any more, radians */

static const double pi = 3.14159265358979323846;

typedef struct search {
    const lightfield *f;
    const bloblist *list;
    const blob **own; /* of each picture: the spot taken for the lamp, or NULL */
} search;

static double elevation(const double d[3])
{
    return asin(fmax(-1, fmin(1, d[2] / v_len(d))));
}

static double off_by(const search *s, const blob *b, const double at[3])
{
    double d[3];

    v_sub(d, at, s->f->pos[b->probe]);
    return elevation(b->dir) - elevation(d);
}

/* A lamp's light is about flux x distance^2; of one height above the plane: */
static double light(const blob *b)
{
    return b->flux / fmax(1e-6, b->dir[2] * b->dir[2]);
}

/* How badly spots fit a lamp there, each picture's best; those without any count as OFF. */
static double misfit_at(const search *s, const double at[3])
{
    double sum = 0;

    for (int k = 0, i = 0; k < s->f->n; k++) {
        double best = OFF;
        for (; i < s->list->n && s->list->b[i].probe == k; i++)
            best = fmin(best, fabs(off_by(s, &s->list->b[i], at)));
        sum += best * best;
    }
    return sum;
}

static void look_everywhere(double at[3], const search *s)
{
    const lightfield *f = s->f;
    double least = 1e300;

    for (int q = 0; q < ACROSS * ACROSS * UP; q++) {
        const double x = 2. * (q % ACROSS) / (ACROSS - 1) - 1,
                     y = 2. * (q / ACROSS % ACROSS) / (ACROSS - 1) - 1,
                     z = LOWEST * pow(HIGHEST / LOWEST, (double)(q / ACROSS / ACROSS) / (UP - 1));
        const double p[3] = {f->len_u / 2 + WIDTH * f->size * x, f->len_v / 2 + WIDTH * f->size * y,
                             z * f->size};
        const double miss = misfit_at(s, p);
        if (miss < least) least = miss, memcpy(at, p, sizeof p);
    }
}

/* Each picture's spot; of several that stand as high, that whose light is most like the others'. */
static void match(search *s, const double at[3])
{
    double usual = 0;
    int n = 0;

    for (int k = 0; k < s->f->n; k++)
        if (s->own[k]) usual += log(light(s->own[k])), n++;
    for (int k = 0, i = 0; k < s->f->n; k++) {
        double least = 1e300;
        s->own[k] = NULL;
        for (; i < s->list->n && s->list->b[i].probe == k; i++) {
            const blob *b = &s->list->b[i];
            const double off = off_by(s, b, at) / OFF, unlike = n ? (log(light(b)) - usual / n) / ALIKE : 0;
            if (fabs(off) < 1 && off * off + unlike * unlike < least)
                least = off * off + unlike * unlike, s->own[k] = b;
        }
    }
}

static void residuals(double *r, const double *p, void *context)
{
    const search *s = context;

    for (int k = 0; k < s->f->n; k++) r[k] = s->own[k] ? off_by(s, s->own[k], p) : 0;
}

/* Where the lamp hangs; returns how many pictures see it, -1 without memory. */
static int find(headings *h, search *s)
{
    const double step[3] = {1e-4, 1e-4, 1e-4};
    double sum = 0;
    int n = 0;

    look_everywhere(h->lamp, s);
    for (int round = 0; round < 3; round++) {
        match(s, h->lamp);
        sum = lm_fit(h->lamp, 3, s->f->n, residuals, s, step, 40);
        if (sum < 0) return -1;
    }
    for (int k = 0; k < s->f->n; k++) n += s->own[k] != NULL;
    h->misfit = sqrt(sum / (n > 3 ? n - 3 : 1));
    return n;
}

/* The picture turned so that its spot lies where the lamp hangs. */
static void turn_to(lightfield *f, place *at, const blob *b, const double lamp[3])
{
    double d[3];

    v_sub(d, lamp, f->pos[b->probe]);
    at->heading += (atan2(d[1], d[0]) - atan2(b->dir[1], b->dir[0])) * 180 / pi;
    at->heading = remainder(at->heading, 360);
    shots_stand(f, b->probe, at);
}

static int settle(headings *h, search *s, lightfield *f, place *at, char *const *pictures, const char *path,
                  errmsg *e)
{
    const int n = find(h, s);

    if (n < 0) return err_set(e, "no memory for headings");
    if (n < FEWEST)
        return err_set(e, "%s: expected headings, or a lamp that four pictures see, found one that %d see",
                       path, n);
    if (h->misfit > MEET)
        return err_set(e,
                       "%s: expected headings, or a lamp whose heights in the pictures meet, found them off "
                       "by %.2g degrees",
                       path, h->misfit * 180 / pi);
    for (int k = 0; k < f->n; k++) {
        if (!at[k].unknown) continue;
        if (!s->own[k])
            return err_set(e,
                           "%s: line %d (%.60s): expected a heading, or a lamp in the picture that the "
                           "others see, found neither",
                           path, at[k].line, pictures[k]);
        turn_to(f, &at[k], s->own[k], h->lamp);
    }
    return 0;
}

int headings_find(headings *h, lightfield *f, place *at, char *const *pictures, const char *path, errmsg *e)
{
    bloblist list = {0};

    memset(h, 0, sizeof *h);
    for (int k = 0; k < f->n; k++) h->n += at[k].unknown;
    if (!h->n) return 0;
    search s = {f, &list, calloc((size_t)f->n + 1, sizeof *s.own)};
    int bad = s.own ? blobs_find(&list, f, OVER, e) : err_set(e, "no memory for headings");
    if (!bad) bad = settle(h, &s, f, at, pictures, path, e);
    free(list.b), free(s.own);
    return bad;
}
