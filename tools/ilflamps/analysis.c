/*
 * analysis.c - from a light field to lamps, what hides them, and what is left.
 */
#include "analysis.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/remark.h"
#include "choose.h"
#include "gradient.h"
#include "oneplace.h"
#include "pictures.h"
#include "vec.h"

enum { TURNS = 3 };      /* looks at probes that are turned */
#define BETTER      .8   /* of the bodies' misfits: turns that leave more are none */
#define OVER        15.0 /* bright spots: times the probe's median luminance */
#define MISFIT      .1   /* rms; a lamp whose spots look like no body that we know stays in the field */
#define MISFIT_WIDE .2   /* of lamps of many texels, whose light is less even */
#define LENS_FITS   .6   /* of an even body's misfit: a lens must look so much more like it */
#define LENS_WIDER  1.5 /* lenses may look so much wider than other lamps: their light is in few directions */

enum { MOST_TIMES = 4 }; /* second looks at all lamps together */
#define OFF    4         /* standard errors of a lamp's distance that it may be off */
#define KNOWN  .02       /* misfit of a sphere that needs no second look */
#define GAINS  .85       /* of the error: a second look that leaves more needs no third */
#define ENOUGH 12        /* probes that see all of a lamp: its body is known */

/* Mean width of a lamp's spots, radians. */
static double wide_spots(const bloblist *l, int number)
{
    double sum = 0;
    int n = 0;

    for (int i = 0; i < l->n; i++)
        if (l->b[i].lamp == number) sum += 2 * l->b[i].reach, n++;
    return n ? sum / n : 0;
}

/* An even body, or where that looks wrong a lens, if it looks much more like it. */
static int body_of(found *it, const bloblist *list, const centre *c, int number, const analysis *a,
                   double limit)
{
    const int r = shape_fit(&it->l.s, c, number, list, &a->f, limit);
    shape lens = {0};

    if (r < 0 || (!r && it->l.s.misfit < MISFIT)) return r;
    const int other = gradient_fit(&lens, c, number, list, &a->f, limit);
    if (other || (!r && lens.misfit > LENS_FITS * it->l.s.misfit)) return other < 0 ? -1 : r;
    it->l.s = lens;
    return 0;
}

static int shapes(analysis *a, const bloblist *list, const centre *c, int n, double limit, const plan *p,
                  errmsg *e)
{
    for (int i = 0; i < n; i++) {
        found *it = &a->lamps[a->n];
        memset(it, 0, sizeof *it);
        if (wide_spots(list, i) > 1.2 * p->max_width) {
            it->l.c = c[i], it->fate = TOO_WIDE, it->l.s.l.radius = 1;
            memcpy(it->l.s.l.centre, c[i].at, sizeof c[i].at);
            a->n++;
            continue;
        }
        const double most = wide_spots(list, i) > 6 * a->f.dp ? MISFIT_WIDE : MISFIT;
        const int r = body_of(it, list, &c[i], i, a, limit);
        if (r < 0) return err_set(e, "no memory for a lamp's shape");
        it->l.c = c[i];
        if (it->l.s.sigma_position > 0)
            it->l.c.sigma = it->l.s.sigma_position; /* the body's, not the spots' */
        a->n++;
        it->fate = r > 0 || it->l.s.misfit > most ? SHAPELESS : TAKEN;
        if (r > 0) continue;
        if (lamp_measure(&it->l, &a->f, limit, e)) return -1;
        if (it->fate == TAKEN && it->l.width > p->max_width * (it->l.s.lens ? LENS_WIDER : 1))
            it->fate = TOO_WIDE;
    }
    return 0;
}

/* Lamps whose texels lie among another's can't be put back alone. */
static int beside_another(const analysis *a, int k)
{
    const double mid[3] = {a->f.len_u / 2, a->f.len_v / 2, 0};
    double d[3], e[3];

    v_sub(d, a->lamps[k].l.s.l.centre, mid), v_unit(d);
    for (int i = 0; i < a->n; i++) {
        if (i == k || a->lamps[i].fate == SHAPELESS) continue;
        v_sub(e, a->lamps[i].l.s.l.centre, mid), v_unit(e);
        const double apart = acos(fmin(1, v_dot(d, e)));
        if (apart < .6 * (a->lamps[i].l.width + a->lamps[k].l.width) + 12 * a->f.dp) return 1;
    }
    return 0;
}

/* A body that may be better known by now: a beam moved its spots' middles, or few probes saw all of it. */
static int doubtful(const shape *s, const model *m)
{
    const ilf_mask_kind kind = m->n ? m->m[ALL][0].kind : ILF_MASK_FOOT;

    if (kind == ILF_MASK_BEAM) return 1;
    if (kind == ILF_MASK_GATE) return s->misfit > KNOWN;
    if (kind != ILF_MASK_LAYER || !m->saw || s->full > ENOUGH) return 0;
    return s->l.shape != ILF_SPHERE || s->misfit > KNOWN;
}

/* What shapes and hides a lamp is known by now: its body is fitted again to what all probes see, and all that
 * follows is done again.  Kept where left-out rows are met better. */
static int once_more(int *times, analysis *a, int k, pictures *pics, double limit, errmsg *e)
{
    found *was = &a->lamps[k], now = {.fate = TAKEN};
    const model *m = &was->best;
    const shape *s = &was->l.s;

    if (was->fate != TAKEN || s->lens || was->l.scatter > 0 || s->l.far || !doubtful(s, m) ||
        beside_another(a, k))
        return 0;
    ++*times;
    lamp_put_back(&was->l, &a->f);
    now.l.s = *s, now.l.c = was->l.c;
    int bad = shape_fit_behind(&now.l.s, was->l.seen, &a->f, limit);
    now.l.s.l.masks = NULL, now.l.s.l.nmasks = 0;
    if (bad < 0) return err_set(e, "no memory for a lamp's shape");
    if (!bad) {
        if (now.l.s.sigma_position > 0) now.l.c.sigma = now.l.s.sigma_position;
        if (lamp_measure(&now.l, &a->f, limit, e) || lamp_take_out(&now.l, &a->f, limit, e)) return -1;
        pictures_add_lamp(pics, &now.l, &a->f);
        if (choose_model(&now, &a->f, pics, e)) return -1;
        if (now.fate == TAKEN && now.best.error < was->best.error) {
            lamp_free(&was->l), model_free(&was->best);
            *was = now;
            return 0;
        }
        lamp_put_back(&now.l, &a->f);
        lamp_free(&now.l), model_free(&now.best);
    }
    return lamp_take_out(&was->l, &a->f, limit, e);
}

/* A lamp that blurred pictures place behind what the user says stands there (its own front, often) would be
 * hidden: it is moved there, as large as it looks from the plane's middle, if that is no further than it may be
 * off. */
static int before_walls(analysis *a, double limit, errmsg *e)
{
    for (int i = 0; i < a->n; i++) {
        lamp *l = &a->lamps[i].l;
        const double mid[3] = {a->f.len_u / 2, a->f.len_v / 2, 0};
        double d[3], x[3];
        if (a->lamps[i].fate != TAKEN || l->scatter <= 0 || l->c.far) continue;
        v_sub(d, l->s.l.centre, mid);
        const double far = v_unit(d);
        surroundings_meet(x, &a->around, mid, d), v_sub(x, x, mid);
        const double part = v_dot(x, d) / far;
        if (part >= 1 || (1 - part) * far > OFF * l->c.sigma) continue;
        lamp now = {.s = l->s, .c = l->c, .scatter = l->scatter};
        for (int c = 0; c < 3; c++) now.s.l.centre[c] = mid[c] + part * far * d[c];
        now.s.l.radius *= part;
        lamp_put_back(l, &a->f);
        lamp_free(l);
        *l = now;
        if (lamp_measure(l, &a->f, limit, e) || lamp_take_out(l, &a->f, limit, e)) return -1;
    }
    return 0;
}

static int explain(analysis *a, const plan *p, double limit, errmsg *e)
{
    pictures pics = {0};
    int hidden = 0, bad;

    for (int i = 0; i < a->n; i++)
        hidden |= a->lamps[i].fate == TAKEN && choose_needed(&a->lamps[i].l, &a->f);
    bad = p->octree             ? surroundings_from(&a->around, p->octree, &a->f, e)
          : hidden || a->f.free ? surroundings_guess(&a->around, &a->f, e)
                                : 0;
    if (!bad && a->around.measured) bad = before_walls(a, limit, e);
    if (!bad && hidden) bad = pictures_make(&pics, &a->f, &a->around, e);
    for (int i = 0; i < a->n && !bad && hidden; i++)
        if (a->lamps[i].fate == TAKEN) pictures_add_lamp(&pics, &a->lamps[i].l, &a->f);
    for (int i = 0; i < a->n && !bad; i++)
        if (a->lamps[i].fate == TAKEN) bad = choose_model(&a->lamps[i], &a->f, &pics, e);
    for (int i = 0, times = 0; i < a->n && !bad && hidden; i++)
        for (int turn = 0; turn < 2 && times < MOST_TIMES && !bad; turn++) {
            const double before = a->lamps[i].best.error;
            bad = once_more(&times, a, i, &pics, limit, e);
            if (a->lamps[i].best.error > GAINS * before) break;
        }
    pictures_free(&pics);
    return bad;
}

/* Of how many lamps the shape is told, and how badly all of them fit. */
static double misfits(const analysis *a)
{
    double sum = 0;

    for (int i = 0; i < a->n; i++) {
        const shape *s = &a->lamps[i].l.s;
        sum += a->lamps[i].fate == TOO_WIDE ? 0 : s->full ? fmin(1, s->misfit) : 1;
    }
    return sum;
}

static void forget(analysis *a)
{
    for (int i = 0; i < a->n; i++) lamp_free(&a->lamps[i].l);
    a->n = 0;
}

/* One look at whether probes are turned: 1 where they were, and have been put right; -1 without memory. */
static int one_turn(steadied *it, analysis *a, bloblist *list, centre *c, int n, double limit)
{
    shape *s = calloc((size_t)n + 1, sizeof *s);

    if (!s) return -1;
    for (int i = 0; i < n; i++) {
        s[i] = a->lamps[i].l.s;
        if (a->lamps[i].fate == TOO_WIDE || !s[i].full || s[i].lens) s[i].misfit = -1;
    }
    const int turned = steady_put_right(it, &a->f, list, s, n, limit);
    for (int i = 0; i < n && turned > 0; i++) centres_again(&c[i], i, list, &a->f);
    free(s);
    return turned;
}

/* Frames of pictures and spots as they were. */
static void turn_back(analysis *a, bloblist *list, const blob *spots, double (*turn)[9])
{
    memcpy(list->b, spots, (size_t)list->n * sizeof *spots);
    free(a->f.turn);
    a->f.turn = turn;
    memset(&a->steady, 0, sizeof a->steady);
}

static int again(analysis *a, const bloblist *list, const centre *c, int n, double limit, const plan *p,
                 errmsg *e)
{
    forget(a);
    return shapes(a, list, c, n, limit, p, e);
}

/* Shapes, and once more where the lamps say that probes are turned; kept where they fit clearly better so. */
static int steady_shapes(analysis *a, bloblist *list, centre *c, int n, double limit, const plan *p,
                         errmsg *e)
{
    const size_t frames = (size_t)a->f.n * sizeof *a->f.turn, spots = (size_t)list->n * sizeof *list->b;
    double(*turn)[9] = a->f.turn ? malloc(frames) : NULL;
    blob *old = malloc(spots + 1);
    centre *at = malloc(((size_t)n + 1) * sizeof *at);
    steadied now;
    int bad = !old || !at || (a->f.turn && !turn) ? err_set(e, "no memory for shapes") : 0, turned = !bad;

    if (!bad && turn) memcpy(turn, a->f.turn, frames);
    if (!bad && spots) memcpy(old, list->b, spots);
    if (!bad) memcpy(at, c, (size_t)n * sizeof *at), bad = shapes(a, list, c, n, limit, p, e);
    const double was = bad ? 0 : misfits(a);
    for (int round = 0; round < TURNS && turned > 0 && !bad; round++) {
        turned = one_turn(&now, a, list, c, n, limit);
        if (turned < 0) bad = err_set(e, "no memory for shapes");
        if (turned <= 0) break;
        if (!round) a->steady = now;
        bad = again(a, list, c, n, limit, p, e);
    }
    if (!bad && a->steady.measured && misfits(a) > BETTER * was) {
        turn_back(a, list, old, turn), turn = NULL;
        bad = again(a, list, at, n, limit, p, e);
    }
    free(turn), free(old), free(at);
    return bad;
}

/* A lamp whose blurred pictures fit a ball: measured so. */
static int take_blurred(analysis *a, const bloblist *list, const centre *c, int number, const plan *p,
                        double limit, errmsg *e)
{
    found *it = &a->lamps[number];
    shape s;
    const int r = shape_fit_ball(&s, c, number, list, &a->f, limit);

    if (r < 0) return err_set(e, "no memory for a lamp's shape");
    if (r || !blur_shows(&s)) return 0;
    lamp_free(&it->l);
    it->l.s = s, it->l.c = *c, it->fate = TAKEN, it->l.scatter = s.sigma_radiance * sqrt(s.full);
    if (s.sigma_position > 0) it->l.c.sigma = s.sigma_position;
    if (lamp_measure(&it->l, &a->f, limit, e)) return -1;
    if (it->l.width > p->max_width) it->fate = TOO_WIDE;
    return 0;
}

/* Where no lamp's spots look like a body, the pictures may be blurred. */
static int blurred_shapes(analysis *a, const bloblist *list, const centre *c, const plan *p, double limit,
                          errmsg *e)
{
    unsigned char *use = malloc((size_t)a->n + 1);
    int sharp = 0, bad = 0;

    if (!use) return err_set(e, "no memory for shapes");
    for (int i = 0; i < a->n; i++) use[i] = a->lamps[i].fate == SHAPELESS, sharp |= a->lamps[i].fate == TAKEN;
    if (!sharp && blur_find(&a->blur, &a->f, use, c, a->n, list, limit))
        bad = err_set(e, "no memory for shapes");
    for (int i = 0; i < a->n && !bad && a->blur.lamps; i++)
        if (use[i]) bad = take_blurred(a, list, &c[i], i, p, limit, e);
    free(use);
    return bad;
}

int analyse(analysis *a, const char *path, const plan *p, errmsg *e)
{
    lightfield f;

    if (lf_read(&f, path, e) || analyse_field(a, &f, p, e)) return -1;
    /* what is left is smooth, and goes into the file as it stood */
    free(a->f.turn);
    a->f.turn = NULL;
    return 0;
}

int analyse_field(analysis *a, lightfield *f, const plan *p, errmsg *e)
{
    bloblist list = {0};
    centre *c = calloc((size_t)p->most + 1, sizeof *c);
    double limit = 0;
    int bad = 0;

    memset(a, 0, sizeof *a);
    a->f = *f;
    memset(f, 0, sizeof *f);
    a->lamps = calloc((size_t)p->most + 1, sizeof *a->lamps);
    if (!c || !a->lamps) bad = err_set(e, "no memory for lamps");
    const clock_t began = clock();
    const int alone = a->f.n == 1 && p->octree; /* what hides a lamp, other places would have to say */
    if (a->f.n == 1 && !p->octree && p->most > 0)
        remark("a single probe",
               "one place can't tell where lamps hang: --geometry says how far the surroundings are");
    if (!bad && p->most > 0) bad = alone ? oneplace_lamps(a, p, e) : blobs_find(&list, &a->f, OVER, e);
    if (!bad && !alone) {
        limit = OVER * blobs_typical(&a->f);
        bad = steady_shapes(a, &list, c, centres_find(c, p->most, &list, &a->f), limit, p, e);
        if (!bad) bad = blurred_shapes(a, &list, c, p, limit, e);
        for (int i = 0; i < list.n; i++) a->stray += list.b[i].lamp < 0;
        a->spots = list.n;
        for (int i = 0; i < a->n && !bad; i++)
            if (a->lamps[i].fate == TAKEN) bad = lamp_take_out(&a->lamps[i].l, &a->f, limit, e);
    }
    if (!bad) bad = alone ? surroundings_from(&a->around, p->octree, &a->f, e) : explain(a, p, limit, e);
    for (int i = a->n; i-- > 0 && !bad;)
        if (a->lamps[i].fate != TAKEN) lamp_put_back(&a->lamps[i].l, &a->f);
    a->cpu_s = (double)(clock() - began) / CLOCKS_PER_SEC;
    free(list.b), free(c);
    if (bad) analysis_free(a);
    return bad;
}

void analysis_free(analysis *a)
{
    for (int i = 0; i < a->n; i++) lamp_free(&a->lamps[i].l), model_free(&a->lamps[i].best);
    free(a->lamps);
    surroundings_free(&a->around);
    lf_free(&a->f);
    memset(a, 0, sizeof *a);
}
