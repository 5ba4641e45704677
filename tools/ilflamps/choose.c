/*
 * choose.c - which hypothesis a lamp gets.  Masks are added one at a time, each time the one whose left-out
 * rows fit best (models that have seen the occluder in the pictures win near ties: left-out probes can't see
 * what happens above the plane), as long as they clearly help.  The chain must beat interpolation between
 * probes; where it doesn't, interpolation is what a narrow lamp gets, and a wide one stays in the field.
 */
#include "choose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gradient.h"
#include "layers.h"
#include "smooth.h"
#include "vec.h"

enum { ROUNDS = 2 };
#define ABRUPT    .6    /* of the light: more between two probes says nothing about where */
#define HELPS     0.9   /* a further mask must bring the error below this part of what it was */
#define STRICT    .4    /* part of the error that a beam or gate may leave */
#define SETTLED   .06   /* part of the error of a bare lens: what its beam leaves is nothing that hides it */
#define REMAINDER .9    /* the measurements' own scatter must not come back as a remainder */
#define NEAR_TIE  1.25  /* of the least error: models that saw the occluder win */
#define BELIEVED  .6    /* of interpolation's error: more is no explanation, and goes wrong above the plane */
#define ONE_SHEET .7    /* the same for a single sheet whose outline the pictures show */
#define ONE_GATE  .4    /* the same for a gate: its edge is hard, and right or wrong altogether */
#define CLOSE     .05   /* error that is believed if it beats interpolation at all */
#define HOPELESS  .85   /* of interpolation's error: after a first mask, a second one won't do */
#define VAGUE     .1    /* error of interpolation that is no picture of what hides */
#define CERTAIN   0.02  /* error that needs no further mask */
#define STEADY    0.012 /* scatter of the shares about 1 of a lamp that nothing hides */
#define WIDE      (3.0) /* texels: a lamp not wider loses nothing by one share for all of it */
#define HARMLESS  .02   /* of all light: error of interpolation that may change sides */

typedef int hypothesis(model *m, const lamp *l, const lightfield *f, const pictures *p);

static const struct {
    hypothesis *fit;
    const char *name;
    int last;   /* nothing is added after it */
    int strict; /* a form that fits or doesn't: half-way is not it */
} TABLE[] = {{gradient_mask, "lens", 0, 1}, {smooth_beam, "beam", 0, 1},   {smooth_gate, "gate", 0, 1},
             {layers_sheet, "sheet", 0, 0}, {layers_stack, "stack", 0, 0}, {smooth_process, "smooth", 1, 0}};
enum { KINDS = sizeof TABLE / sizeof *TABLE };

static void say(model *m, const char *name)
{
    const size_t n = strlen(m->name);

    snprintf(m->name + n, sizeof m->name - n, "%s%s", n ? " x " : "", name);
}

/* Error that asks for no further mask: twice the scatter of what probes that see all of the lamp say. */
static double enough(const lamp *l)
{
    double sum = 0, all = 0;

    for (int k = 0; k < l->nrows; k++) {
        const row *r = &l->rows[k];
        if (fabs(l->seen[r->probe] - 1) > fmax(.03, 2 * l->scatter)) continue;
        sum += r->share * (r->value - 1) * (r->value - 1), all += r->share;
    }
    return all > 0 ? fmax(CERTAIN, 2 * sqrt(sum / all)) : CERTAIN;
}

/* Light of a lamp that probe k measured, less what masks say. */
static void unexplained(double *v, const model *base, const lamp *l, const lightfield *f)
{
    for (int k = 0; k < f->n; k++) v[k] = 0;
    for (int k = 0; k < l->nrows; k++) {
        const row *r = &l->rows[k];
        v[r->probe] += r->share * (r->value - model_row(r, l, f, base->m[ALL], base->n));
    }
}

/* Part of the pairs of neighbours between which all of the light comes or goes: where in between, rows don't
 * say. */
static double gaps(int *n, const double *v, const lamp *l, const lightfield *f)
{
    int all = 0;

    *n = 0;
    for (int k = 0; k < f->n; k++)
        for (int q = k + 1; q < f->n && (f->free || q <= k + f->nu); q++) {
            if (!lf_neighbours(f, k, q)) continue;
            if (l->seen[k] < 0 && l->seen[q] < 0) continue;
            all++, *n += fabs(v[k] - v[q]) > ABRUPT;
        }
    return all ? (double)*n / all : 0;
}

/* Error that rows of left-out probes don't show: an edge between two probes lies anywhere between them, and a
 * quarter of the light there is wrong on the average.  (Forms of few numbers are held by all their edges
 * together, and say themselves how sure they are.)
 */
static double unresolved(const model *base, const lamp *l, const lightfield *f)
{
    double *v = malloc((size_t)f->n * sizeof *v), part = 0;
    int n = 0;

    if (!v) return 1;
    unexplained(v, base, l, f);
    part = gaps(&n, v, l, f);
    free(v);
    return sqrt(.25 * part);
}

/* A lens whose light is as good as explained. */
static int settled(const model *m, const model *base, const lamp *l)
{
    return l->s.lens && model_doubt(m) < SETTLED * base->error;
}

/* One more mask: the best of all kinds (in the table's order, until one is good enough) goes to *best; *last
 * if nothing should follow it. */
static int one_more(model *best, int *last, const model *base, const lamp *l, const lightfield *f,
                    const pictures *pics)
{
    model m[KINDS];
    int ok[KINDS], pick = -1, bad = 0;
    const double goal = enough(l), unknown = unresolved(base, l, f);

    for (int k = 0; k < KINDS; k++) {
        ok[k] = 0, memset(&m[k], 0, sizeof m[k]);
        if ((pick >= 0 && model_doubt(&m[pick]) < goal) || (TABLE[k].strict && base->shaped)) continue;
        if (pick >= 0 && !TABLE[k].strict && settled(&m[pick], base, l)) continue;
        bad |= model_copy(&m[k], base);
        const int r = bad ? -1 : TABLE[k].fit(&m[k], l, f, pics);
        if (r == 0 && !TABLE[k].strict && !m[k].saw) m[k].blind = fmax(m[k].blind, unknown);
        const double miss = model_doubt(&m[k]);
        ok[k] = r == 0 && (!TABLE[k].strict || miss < fmax(STRICT * model_doubt(base), goal)), bad |= r < 0;
        if (ok[k] && (pick < 0 || miss < model_doubt(&m[pick]))) pick = k;
    }
    for (int k = 0; k < KINDS && pick >= 0; k++)
        if (ok[k] && m[k].saw > m[pick].saw && model_doubt(&m[k]) < NEAR_TIE * model_doubt(&m[pick]))
            pick = k;
    for (int k = 0; k < KINDS; k++)
        if (k != pick) model_free(&m[k]);
    if (pick < 0) return bad ? -1 : 1;
    *best = m[pick], *last = TABLE[pick].last;
    if (settled(best, base, l)) *last = 1;
    best->shaped |= TABLE[pick].strict;
    say(best, best->m[ALL][base->n].kind == ILF_MASK_BALL ? "ball" : TABLE[pick].name);
    return bad ? -1 : 0;
}

static int chain(model *base, const lamp *l, const lightfield *f, const pictures *pics, double interpolation)
{
    for (int round = 0; round < ROUNDS && base->error > enough(l); round++) {
        model next;
        if (round && model_doubt(base) > HOPELESS * interpolation) break;
        int last, r = one_more(&next, &last, base, l, f, pics);
        if (r < 0) return -1;
        if (r > 0) break;
        if (model_doubt(&next) >= HELPS * model_doubt(base)) {
            model_free(&next);
            break;
        }
        model_free(base);
        *base = next;
        if (last) break;
    }
    return 0;
}

/* What the masks leave of the measurements, interpolated: kept where it helps. */
static int remainder_too(model *base, const lamp *l, const lightfield *f)
{
    model more;

    if (!base->n || base->n >= MODEL_MASKS) return 0;
    if (model_copy(&more, base) || smooth_interpolation(&more, l, f, 1) < 0) return -1;
    if (more.error < REMAINDER * base->error) {
        model_free(base);
        *base = more;
        say(base, "remainder");
    } else model_free(&more);
    return 0;
}

/* Whether the masks tell so much more than interpolation that they may be trusted where no probe stands. */
static int explains(const model *m, const lamp *l, double interpolation)
{
    const int sheet = m->n == 1 && m->saw && m->m[ALL][0].kind == ILF_MASK_LAYER,
              gate = m->n == 1 && m->m[ALL][0].kind == ILF_MASK_GATE;
    const double part = sheet ? ONE_SHEET : gate ? ONE_GATE : BELIEVED;

    return m->error < fmax(hypot(CLOSE, l->scatter), part * interpolation) &&
           m->error < HELPS * interpolation;
}

static int take_masks(lamp *l, const model *m)
{
    ilf_luminaire *b = &l->s.l;

    b->masks = calloc((size_t)(m->n + 1), sizeof *b->masks);
    if (!b->masks) return -1;
    for (int k = 0; k < m->n; k++) {
        b->masks[k] = m->m[ALL][k];
        const size_t bytes = mask_bytes(&b->masks[k]);
        if (b->masks[k].grid) {
            b->masks[k].grid = malloc(bytes);
            if (!b->masks[k].grid) return -1;
            memcpy(b->masks[k].grid, m->m[ALL][k].grid, bytes);
        }
        b->nmasks++;
    }
    return 0;
}

/* The lamp's part of the light on the plane, were it not hidden. */
static double part_of_light(const lamp *l, const lightfield *f)
{
    double own = 0, rest = 0, d[3];

    for (int k = 0; k < f->n; k++) {
        double e[3];
        v_sub(e, l->s.l.centre, f->pos[k]);
        own += l->s.radiance * ilf_luminaire_omega(&l->s.l, f->pos[k]) * fmax(0, e[2]) / v_len(e);
        for (int y = 0; y < f->np; y++)
            for (int x = 0; x < f->nt; x++) {
                lf_direction(d, f, k, x + .5, y + .5);
                rest += lf_lum(f, k, x, y) * lf_texel_sr(f, y) * fmax(0, d[2]);
            }
    }
    return own / (own + rest + 1e-300);
}

/* Scatter of a lamp's light about all of it: of its rows, or of whole probes, whose rows' errors may cancel (a
 * probe that is turned a little sees one quarter brighter and the opposite one darker). */
static double alone(const lamp *l, const lightfield *f)
{
    model none = {0};
    double sum = 0;
    int n = 0;

    model_judge(&none, l, f);
    for (int k = 0; k < f->n; k++)
        if (l->seen[k] >= 0) sum += (l->seen[k] - 1) * (l->seen[k] - 1), n++;
    return n ? fmin(none.error, sqrt(sum / n)) : none.error;
}

int choose_needed(const lamp *l, const lightfield *f)
{
    return alone(l, f) > STEADY;
}

int choose_model(found *it, const lightfield *f, const pictures *pics, errmsg *e)
{
    lamp *l = &it->l;
    model plain = {0};
    const double texels = l->width / fmax(f->dp, f->dt);

    memset(&it->best, 0, sizeof it->best);
    model_judge(&it->best, l, f);
    if (smooth_interpolation(&plain, l, f, 0) < 0) goto memory;
    it->interpolation = plain.error;
    say(&plain, "interpolation");
    it->fate = TAKEN;
    const int needed = choose_needed(l, f);
    if (needed && (chain(&it->best, l, f, pics, plain.error) || remainder_too(&it->best, l, f))) goto memory;
    it->best.error = needed ? model_doubt(&it->best) : alone(l, f);
    if (needed && !explains(&it->best, l, it->interpolation)) {
        if (texels > WIDE || plain.error > VAGUE || plain.error * part_of_light(l, f) > HARMLESS)
            it->fate = UNEXPLAINED;
        model_free(&it->best);
        it->best = plain;
    } else model_free(&plain);
    if (take_masks(l, &it->best)) goto memory;
    return 0;
memory:
    return err_set(e, "no memory for a lamp's hypotheses");
}
