/*
 * suspects.c - see suspects.h.
 */
#include "suspects.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/vec.h"
#include "shots.h"

enum { COARSE = 2, FEWEST = 4 };
#define SHARE  .65  /* of the points must agree: the rest may be hidden */
#define CLEAR  .012 /* disagreement (log luminance) that is no matter of small errors, */
#define TIMES  4    /* nor this many times the others' */
#define HOPES  .4   /* part of its disagreement that an explanation may leave */
#define MOSTLY .05  /* disagreement of the pictures on the average that is no matter of small errors */
#define BEYOND .1   /* disagreement that is refused where nothing explains it */

typedef struct court {
    lightfield *f;
    place *at;
    const views *v;
    const landmarks *l;
    int level, points;
    double *ref;   /* of each point, log luminance */
    double *value; /* pictures x points; NAN: not known */
    double *tmp;
    char *out;       /* pictures that have no say */
    double *differs; /* of each picture */
} court;

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double quantile(double *v, int n, double part)
{
    if (!n) return NAN;
    qsort(v, (size_t)n, sizeof *v, by_value);
    return v[(int)(part * (n - 1) + .5)];
}

/* What picture k shows of all points. */
static void look(double *value, const court *c, int k)
{
    for (int i = 0; i < c->points; i++) {
        double e[3];
        v_sub(e, c->l->m[i].x, c->f->pos[k]);
        value[i] = log(views_look(c->v, c->level, k, e));
    }
}

/* Size of the differences from the reference, once the picture's own brightness is taken off. */
static double difference(const court *c, const double *value)
{
    int n = 0;

    for (int i = 0; i < c->points; i++)
        if (isfinite(value[i]) && isfinite(c->ref[i])) c->tmp[n++] = value[i] - c->ref[i];
    if (n < c->points / 8 || n < 16) return NAN;
    const double mid = quantile(c->tmp, n, .5);
    for (int i = 0; i < n; i++) c->tmp[i] = fabs(c->tmp[i] - mid);
    return quantile(c->tmp, n, SHARE);
}

/* Medians over the pictures that have a say. */
static void set_reference(court *c)
{
    for (int i = 0; i < c->points; i++) {
        int n = 0;
        for (int k = 0; k < c->f->n; k++) {
            const double v = c->value[(size_t)k * (size_t)c->points + (size_t)i];
            if (!c->out[k] && isfinite(v)) c->tmp[n++] = v;
        }
        c->ref[i] = n >= 3 ? quantile(c->tmp, n, .5) : NAN;
    }
}

/* Median of the differences of those that have a say. */
static double usual(const court *c)
{
    int n = 0;

    for (int k = 0; k < c->f->n; k++)
        if (!c->out[k] && isfinite(c->differs[k])) c->tmp[n++] = c->differs[k];
    return quantile(c->tmp, n, .5);
}

static double limit_of(double usual_one)
{
    return fmax(CLEAR, TIMES * usual_one);
}

/* Who is out; returns how many. */
static int accuse(court *c)
{
    int n = 0;

    for (int round = 0; round < 3; round++) {
        set_reference(c);
        for (int k = 0; k < c->f->n; k++)
            c->differs[k] = difference(c, c->value + (size_t)k * (size_t)c->points);
        const double most = limit_of(usual(c));
        n = 0;
        for (int k = 0; k < c->f->n; k++) n += c->out[k] = c->differs[k] > most;
    }
    set_reference(c);
    return n;
}

/* Picture k's difference if it had this place. */
static double if_at(court *c, int k, const place *at)
{
    double *value = c->value + (size_t)k * (size_t)c->points;

    shots_stand(c->f, k, at);
    look(value, c, k);
    const double d = difference(c, value);
    shots_stand(c->f, k, &c->at[k]);
    return isfinite(d) ? d : 1e30;
}

/* ---- what may be meant ---------------------------------------------------------------------------- */

enum { WAYS = 9, HEADINGS = 3 };
static const char *const WAY[WAYS] = {"its heading with the other sign",
                                      "its heading turned by 180 degrees",
                                      "its heading counted clockwise from +y",
                                      "its pitch and roll with the other sign",
                                      "x with the other sign",
                                      "y with the other sign",
                                      "x and y in each other's place",
                                      "z with the other sign",
                                      "pitch and roll in each other's place"};

static place meant(const place *p, int way)
{
    place q = *p;

    if (way == 0) q.heading = -p->heading;
    if (way == 1) q.heading = p->heading + 180;
    if (way == 2) q.heading = 90 - p->heading;
    if (way == 3) q.pitch = -p->pitch, q.roll = -p->roll;
    if (way == 4) q.at[0] = -p->at[0];
    if (way == 5) q.at[1] = -p->at[1];
    if (way == 6) q.at[0] = p->at[1], q.at[1] = p->at[0];
    if (way == 7) q.at[2] = -p->at[2];
    if (way == 8) q.pitch = p->roll, q.roll = p->pitch;
    return q;
}

static void stand_at(court *c, int k, const place *p)
{
    for (int i = 0; i < 3; i++) c->at[k].at[i] = p->at[i];
    c->at[k].heading = p->heading, c->at[k].pitch = p->pitch, c->at[k].roll = p->roll;
    shots_stand(c->f, k, &c->at[k]);
}

static const char *name(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? slash + 1 : path;
}

/* The other suspect with which picture k changed places; -1: none. */
static int swapped(double *after, court *c, int k)
{
    int best = -1;

    for (int q = 0; q < c->f->n; q++) {
        if (q == k || !c->out[q]) continue;
        const double d = fmax(if_at(c, k, &c->at[q]), if_at(c, q, &c->at[k]));
        if (d < *after) *after = d, best = q;
    }
    return best;
}

/* A heading that fits, whatever the line says. */
static double any_heading(place *best, court *c, int k)
{
    double least = 1e30;

    for (int step = 0; step < 360 + 20; step++) {
        place p = c->at[k];
        p.heading = step < 360 ? step : best->heading + (step - 370) * .1;
        const double d = if_at(c, k, &p);
        if (step < 360 ? d < least : d < .999 * least) {
            least = d;
            if (step < 360) *best = p;
        }
    }
    return least;
}

static void say(suspect *s, const place *at, char *const *pictures, const char *what)
{
    const int swap = s->other >= 0 && at[s->other].line < at[s->picture].line;
    const int a = swap ? s->other : s->picture, b = swap ? s->picture : s->other;

    if (b >= 0)
        (void)!snprintf(s->words, sizeof s->words, "lines %d (%.60s) and %d (%.60s): swapped", at[a].line,
                        name(pictures[a]), at[b].line, name(pictures[b]));
    else
        (void)!snprintf(s->words, sizeof s->words, "line %d (%.60s): %.100s", at[a].line, name(pictures[a]),
                        what);
}

/* What explains a suspect best; puts it right unless `keep`.  0 if nothing does. */
static int explain(suspect *s, court *c, char *const *pictures, int keep)
{
    const double goal = HOPES * s->before;
    double best = 1e30;
    place fits = c->at[s->picture];
    char what[120] = "";

    s->other = swapped(&best, c, s->picture);
    if (best > goal) s->other = -1, best = 1e30;
    for (int way = 0; way < WAYS; way++) {
        const place q = meant(&c->at[s->picture], way);
        const double d = if_at(c, s->picture, &q);
        if (d < .8 * best && d < goal)
            best = d, fits = q, s->other = -1, (void)!snprintf(what, sizeof what, "%s", WAY[way]);
    }
    place q = c->at[s->picture];
    const double d = any_heading(&q, c, s->picture);
    if (d < .6 * best && d < goal) {
        best = d, fits = q, s->other = -1;
        (void)!snprintf(what, sizeof what, "a heading of %.4g degrees instead of %.4g", q.heading,
                        c->at[s->picture].heading);
    }
    if (best > goal) return 0;
    s->after = best;
    say(s, c->at, pictures, what);
    if (s->other >= 0) c->out[s->other] = 0;
    c->out[s->picture] = 0;
    if (keep) return 1;
    if (s->other >= 0) {
        const place a = c->at[s->picture], b = c->at[s->other];
        stand_at(c, s->picture, &b), stand_at(c, s->other, &a);
    } else stand_at(c, s->picture, &fits);
    return 1;
}

/* ---- all ------------------------------------------------------------------------------------------ */

static int court_make(court *c)
{
    const size_t n = (size_t)c->f->n, points = (size_t)c->points;

    c->ref = malloc(points * sizeof *c->ref), c->value = malloc(n * points * sizeof *c->value);
    c->tmp = malloc((n + points) * sizeof *c->tmp), c->out = calloc(n, 1);
    c->differs = malloc(n * sizeof *c->differs);
    if (!c->ref || !c->value || !c->tmp || !c->out || !c->differs) return -1;
    for (int k = 0; k < c->f->n; k++) look(c->value + (size_t)k * points, c, k);
    return 0;
}

static void court_free(court *c)
{
    free(c->ref), free(c->value), free(c->tmp), free(c->out), free(c->differs);
}

/* Median disagreement if all lines were meant in a way (below 0: as they are). */
static double if_all(court *c, int way)
{
    for (int k = 0; k < c->f->n; k++) {
        const place p = way < 0 ? c->at[k] : meant(&c->at[k], way);
        shots_stand(c->f, k, &p);
        look(c->value + (size_t)k * (size_t)c->points, c, k);
    }
    (void)accuse(c);
    return usual(c);
}

/* All headings may be counted another way than the page says.  Puts them right unless `keep`; 1 if so. */
static int explain_all(suspect *s, court *c, int keep)
{
    double best = HOPES * s->before;
    int which = -1;

    for (int way = 0; way < HEADINGS; way++) {
        const double d = if_all(c, way);
        if (d < best) best = d, which = way;
    }
    if (which >= 0) {
        s->after = best;
        (void)!snprintf(s->words, sizeof s->words, "all lines: %s", WAY[which]);
        for (int k = 0; k < c->f->n && !keep; k++) {
            const place p = meant(&c->at[k], which);
            stand_at(c, k, &p);
        }
    }
    (void)if_all(c, -1);
    return which >= 0;
}

static int judge(suspects *all, court *c, char *const *pictures, int keep, errmsg *e)
{
    suspect everybody = {.picture = -1, .other = -1};

    (void)accuse(c);
    all->s = calloc((size_t)c->f->n + 1, sizeof *all->s);
    if (!all->s) return err_set(e, "no memory for suspects");
    everybody.before = usual(c);
    if (everybody.before > MOSTLY && explain_all(&everybody, c, keep)) all->s[all->n++] = everybody;
    all->others = usual(c);
    if (all->others > BEYOND && !keep)
        return err_set(
            e,
            "expected pictures that agree at their places, found a disagreement of %.2g %% (median of all "
            "pictures), which no way of counting their headings explains",
            100 * all->others);
    for (int k = 0; k < c->f->n; k++) {
        suspect s = {.picture = k, .other = -1, .before = c->differs[k]};
        if (!c->out[k]) continue;
        if (explain(&s, c, pictures, keep)) all->s[all->n++] = s;
    }
    for (int k = 0; k < c->f->n; k++)
        if (c->out[k] && c->differs[k] > BEYOND && !keep)
            return err_set(
                e,
                "line %d (%.60s): expected a picture that agrees with the others at its place, found a "
                "disagreement of %.2g %% (theirs: %.2g %%), which no swap, sign or heading explains",
                c->at[k].line, name(pictures[k]), 100 * c->differs[k], 100 * all->others);
    return 0;
}

int suspects_find(suspects *all, lightfield *f, place *at, char *const *pictures, const views *v,
                  const landmarks *l, int keep, errmsg *e)
{
    court c = {.f = f,
               .at = at,
               .v = v,
               .l = l,
               .level = v->n > COARSE ? COARSE : v->n - 1,
               .points = l->n - l->creases};
    int bad;

    memset(all, 0, sizeof *all);
    if (f->n < FEWEST) return 0;
    bad = court_make(&c) ? err_set(e, "no memory for suspects") : judge(all, &c, pictures, keep, e);
    court_free(&c);
    if (bad) suspects_free(all);
    return bad;
}

void suspects_free(suspects *all)
{
    free(all->s);
    memset(all, 0, sizeof *all);
}
