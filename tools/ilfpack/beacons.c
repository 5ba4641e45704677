/*
 * beacons.c - see beacons.h.
 */
#include "beacons.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/centres.h"
#include "ilflamps/vec.h"

enum { MOST = 24 };
#define OVER  15.  /* bright: times the picture's median luminance */
#define WHOLE .985 /* of the largest flux x distance^2, lens' and gains' differences aside */

/* Flux x distance^2 of a spot. */
static double power(const blob *b, const centre *c, const lightfield *f)
{
    double e[3];

    v_sub(e, c->at, f->pos[b->probe]);
    return b->flux * v_dot(e, e);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x < y) - (x > y);
}

/* The light of a lamp that is seen whole: that of the second brightest spot. */
static double whole(const bloblist *list, int lamp, const centre *c, const lightfield *f)
{
    double *v = malloc((size_t)(list->n + 1) * sizeof *v), top = 0;
    int n = 0;

    for (int i = 0; v && i < list->n; i++)
        if (list->b[i].lamp == lamp) v[n++] = power(&list->b[i], c, f);
    if (n > 1) {
        qsort(v, (size_t)n, sizeof *v, by_value);
        top = v[n > 5 ? 2 : 1];
    }
    free(v);
    return top;
}

static void add_lamp(beacons *b, const bloblist *list, int lamp, const centre *c, const lightfield *f)
{
    const double least = WHOLE * whole(list, lamp, c, f) * .95; /* gains may differ */
    const int first = b->n;

    for (int i = 0; i < list->n; i++) {
        if (list->b[i].lamp != lamp || power(&list->b[i], c, f) < least) continue;
        sighting *s = &b->s[b->n++];
        s->picture = list->b[i].probe, s->lamp = b->lamps;
        memcpy(s->dir, list->b[i].dir, sizeof s->dir);
        lf_inward(s->dir, f, s->picture);
    }
    if (b->n - first < 3) b->n = first;
    else memcpy(b->at[b->lamps++], c->at, sizeof c->at);
}

int beacons_find(beacons *b, const lightfield *f, errmsg *e)
{
    bloblist list;
    centre c[MOST];

    memset(b, 0, sizeof *b);
    if (blobs_find(&list, f, OVER, e)) return -1;
    const int n = centres_find(c, MOST, &list, f);
    b->at = malloc(MOST * sizeof *b->at), b->s = malloc((size_t)(list.n + 1) * sizeof *b->s);
    int bad = b->at && b->s ? 0 : err_set(e, "no memory for beacons");
    for (int i = 0; i < n && !bad; i++)
        if (!c[i].far) add_lamp(b, &list, i, &c[i], f);
    free(list.b);
    return bad;
}

void beacons_free(beacons *b)
{
    free(b->at), free(b->s);
    memset(b, 0, sizeof *b);
}
