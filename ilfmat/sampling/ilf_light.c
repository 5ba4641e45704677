/*
 * ilf_light.c - what comes to a point straight from the bright part of a light field.
 *
 * The samples are drawn in two steps (Talbot, Cline, Egbert, "Importance Resampling for Global Illumination",
 * 2005). Many candidates come from the slice of what is bright around the point, and get the weight
 *
 *     w = f(d) X(x, d) / p(d)
 *
 * where f is how much the lobe's coefficient counts, X the excess's luminance as looked up without tracing
 * anything, and p the density of the draw.  Of these a few are chosen in proportion to w, in the order of the
 * map (so that they spread over it), and only those are traced.  Each counts
 *
 *     coef X' V / (f X)  mean(w) / n
 *
 * where X' is what the ray met and V whether it came through.  This has the right mean whatever X is, as long
 * as it is not 0 where X' isn't; with depth correction, where X is only an estimate, a part of the map's own
 * weight is added.
 *
 * The number of rays goes with the point's weight, and falls where earlier tests in the same cube of space
 * all had the same result.  So many candidates are drawn that their part of the error costs no more than the
 * rays' part: with the root of the weights' variance, as earlier points in the cube had it.  These tests and
 * points are others, so that the mean stays right.
 */
#include <stdlib.h>

#include "ilf_sampler.h"

/* Candidates per ray: most; least; and between, in proportion to their weights' coefficient of variation.
 * A lamp of 2 degrees fills a small part of the cells that must be drawn from: in the judged scene
 * (bench/render, -di 16 -ad 64) 16 in place of 4 give 4.2 times as much for the time.  The others balance the
 * two parts of the error: with a candidate's cost a 20th of a ray's, their number goes as sqrt(20) times the
 * ratio of the two deviations; the rest is tuned. */
#define MOST_CANDIDATES          16
#define FEWEST_CANDIDATES        2
#define CANDIDATES_PER_DEVIATION 20.0

/* But at least so many for a point that counts in full, and for any. */
#define SEEN_CANDIDATES  64
#define LEAST_CANDIDATES 8

/* Tests in a cube before they are believed; a false "all the same" then has a chance of 1e-2 even where one
 * ray in 30 differs. */
#define BELIEVED_TESTS 128

/* By this many times fewer rays where all of them were alike. */
#define FEWER_IF_SURE 8

/* Part of the map's expectation that is added to the estimate.  More sends rays where nothing is. */
#define DOUBT 0.01

/* Steps of an additive recurrence that fills the square evenly: 1/g and 1/g^2, g^3 = g + 1 (M. Roberts, "The
 * Unreasonable Effectiveness of Quasirandom Sequences", 2018). */
#define STEP_V 0.75487766624669276
#define STEP_W 0.56984029099805327

typedef struct candidate {
    double dir[3];
    double target; /* f X: its chance is that over pdf */
    double weight; /* target / pdf */
} candidate;

struct ilf_scratch {
    candidate *c;
    unsigned char *coef; /* of each candidate */
    size_t room, coef_bytes;
};

/* All that a point's functions pass on. */
typedef struct lighting {
    ilf_sampler *s;
    const ilf_point *at;
    const ilf_host *host;
    ilf_slice *slice;
    ilf_scratch *mem;
    int candidates, rays; /* to draw, to trace */
    int n;                /* candidates that count */
    double sum, sum2;     /* of their weights, and of the weights' squares */
} lighting;

/* ---- memory ----------------------------------------------------------------------------------- */

void ilf_scratch_free(ilf_scratch *m)
{
    if (!m) return;
    free(m->c);
    free(m->coef);
    free(m);
}

/* The sampler's own, or another one where a ray's point is lit while the ray's own point still needs it. */
static ilf_scratch *borrow(ilf_sampler *s, int n, size_t coef_bytes)
{
    ilf_scratch *m = s->scratch ? s->scratch : calloc(1, sizeof *m);

    s->scratch = NULL;
    if (!m || ((size_t)n <= m->room && coef_bytes == m->coef_bytes)) return m;
    candidate *c = realloc(m->c, (size_t)n * sizeof *c);
    if (c) m->c = c;
    unsigned char *coef = realloc(m->coef, (size_t)n * coef_bytes + 1);
    if (coef) m->coef = coef;
    m->room = c && coef ? (size_t)n : 0;
    m->coef_bytes = coef_bytes;
    if (m->room) return m;
    ilf_scratch_free(m);
    return NULL;
}

static void give_back(ilf_sampler *s, ilf_scratch *m)
{
    ilf_scratch_free(s->scratch);
    s->scratch = m;
}

/* ---- how many --------------------------------------------------------------------------------- */

static void choose_numbers(lighting *l)
{
    const ilf_point *p = l->at;
    const slice_past *past = &l->slice->past;
    int rays = (int)(p->samples * p->weight + 0.999);

    rays = rays < 1 ? 1 : rays > p->samples ? p->samples : rays;
    int n = rays * MOST_CANDIDATES;
    if (past->tests >= BELIEVED_TESTS && past->mean2 > 0 && !p->narrow) {
        const double d = CANDIDATES_PER_DEVIATION * sqrt(past->var / past->mean2);
        const int none = past->visible <= 0;

        if (d < MOST_CANDIDATES) n = (int)(rays * (d > FEWEST_CANDIDATES ? d : FEWEST_CANDIDATES));
        if (none || past->visible >= past->tests) rays = (rays + FEWER_IF_SURE - 1) / FEWER_IF_SURE;
        if (none && n > rays * MOST_CANDIDATES) n = rays * MOST_CANDIDATES;
    }
    if (n < SEEN_CANDIDATES * p->weight) n = (int)(SEEN_CANDIDATES * p->weight);
    l->candidates = n < LEAST_CANDIDATES ? LEAST_CANDIDATES : n;
    l->rays = rays;
}

/* ---- candidates ------------------------------------------------------------------------------- */

/* Luminance of the excess towards dir, for light that is about `dist` away; nothing is traced. */
static ilf_status excess_at(double *excess, const lighting *l, const double dir[3], double dist,
                            ilf_error *err)
{
    const ilf_patches *p = l->s->of;
    const double *x = l->at->position;
    const int near = p->mode == ILF_DEPTH && isfinite(dist);
    const double hit[3] = {x[0] + (near ? dist * dir[0] : 0), x[1] + (near ? dist * dir[1] : 0),
                           x[2] + (near ? dist * dir[2] : 0)};
    float rgb[3];
    const ilf_status st =
        ilf_eval(rgb, p->field, &p->frame, NULL, dir, hit, near ? ILF_DEPTH : ILF_NO_DEPTH, err);

    if (st == ILF_OK) *excess = ilf_luminance(rgb) * ilf_excess_part(rgb, p->threshold);
    return st;
}

/* How far the auxiliary geometry is.  A map that expects nothing in a direction knows no distance, and a
 * wrong one shows lamps where there are none: one such candidate in a thousand outweighs all true ones. */
static double distance_to(const lighting *l, const double dir[3])
{
    const double *x = l->at->position;
    double hit[3];

    if (!l->host->hit || !l->host->hit(hit, x, dir, l->host->context)) return HUGE_VAL;
    const double d[3] = {hit[0] - x[0], hit[1] - x[1], hit[2] - x[2]};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* An estimate of the excess towards a candidate: above 0 wherever there may be some. */
static ilf_status estimate(double *excess, const lighting *l, const double dir[3], ilf_draw *dr,
                           ilf_error *err)
{
    const int depth = l->s->of->mode == ILF_DEPTH;
    double x;
    ilf_status st = excess_at(excess, l, dir, dr->far, err);

    if (st != ILF_OK || !depth) return st;
    if (!isfinite(dr->far) && *excess > 0) {
        dr->near = dr->far = distance_to(l, dir);
        st = excess_at(excess, l, dir, dr->far, err);
    }
    if (st == ILF_OK && dr->near < ONE_DISTANCE * dr->far) {
        st = excess_at(&x, l, dir, dr->near, err);
        if (st == ILF_OK && x > *excess) *excess = x;
    }
    *excess += DOUBT * (dr->expected + l->s->of->threshold);
    return st;
}

static ilf_status draw_candidates(lighting *l, ilf_error *err)
{
    const ilf_frame *fr = &l->s->of->frame;
    const ilf_host *h = l->host;
    const double u = h->random(ILF_ALONG_MAP, h->context);
    double v = h->random(ILF_IN_CELL_U, h->context), w = h->random(ILF_IN_CELL_V, h->context);

    for (int k = 0; k < l->candidates; k++) {
        candidate *c = &l->mem->c[l->n];
        void *coef = l->mem->coef + (size_t)l->n * h->coef_bytes;
        ilf_draw dr;

        v += STEP_V, v -= v >= 1;
        w += STEP_W, w -= w >= 1;
        ilf_sample(&dr, l->slice, (k + u) / l->candidates, v, w);
        for (int a = 0; a < 3; a++)
            c->dir[a] = dr.dir[0] * fr->u[a] + dr.dir[1] * fr->v[a] + dr.dir[2] * fr->n[a];
        const double f = h->lobe(coef, c->dir, l->at->lobes, h->context);
        double excess;
        if (!(f > 0)) continue;
        const ilf_status st = estimate(&excess, l, c->dir, &dr, err);
        if (st != ILF_OK) return st;
        c->target = f * excess;
        if (!(c->target > 0)) continue;
        c->weight = c->target / dr.pdf;
        l->sum += c->weight;
        l->sum2 += c->weight * c->weight;
        l->n++;
    }
    l->s->work.candidates += l->candidates;
    return ILF_OK;
}

/* ---- rays ------------------------------------------------------------------------------------- */

/* Choose by weight, in steps along the map, and trace. */
static void trace_chosen(lighting *l, slice_past *past)
{
    const ilf_host *h = l->host;
    const double step = l->sum / l->rays;
    double next = step * h->random(ILF_CHOICE, h->context), passed = 0;

    for (int k = 0; k < l->n; k++) {
        const candidate *c = &l->mem->c[k];
        int times = 0;

        passed += c->weight;
        for (; next < passed; next += step) times++;
        if (!times) continue;
        const ilf_aim aim = {c->dir, l->mem->coef + (size_t)k * h->coef_bytes,
                             times * step / ((double)l->candidates * c->target)};
        past->tests += times;
        if (h->shadow(&aim, h->context)) past->visible += times;
        l->s->work.rays++;
    }
}

static void remember(slice_past *sum, const slice_past *more)
{
    sum->visible += more->visible;
    sum->tests += more->tests;
    sum->mean2 += more->mean2;
    sum->var += more->var;
}

static ilf_status light_straight(lighting *l, ilf_error *err)
{
    slice_past past = {0};

    choose_numbers(l);
    l->mem = borrow(l->s, l->candidates, l->host->coef_bytes);
    if (!l->mem) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for candidates", l->s->of->field->path);
    const ilf_status st = draw_candidates(l, err);
    if (st == ILF_OK && l->n) {
        if (!l->at->narrow) {
            past.mean2 = l->sum * l->sum / ((double)l->candidates * l->candidates);
            past.var = l->sum2 / l->candidates - past.mean2;
        }
        l->s->busy++;
        trace_chosen(l, &past);
        l->s->busy--;
        if (!l->at->apart) remember(&l->slice->past, &past);
    }
    give_back(l->s, l->mem);
    return st;
}

ilf_status ilf_light(ilf_sampler *s, const ilf_point *point, const ilf_host *host, ilf_error *err)
{
    lighting l = {.s = s, .at = point, .host = host};

    if (s->of->n == 0) return ILF_OK;
    if (point->lobes) {
        ilf_status st = ilf_sampler_slice(&l.slice, s, point->position, err);

        if (st == ILF_OK && l.slice) st = light_straight(&l, err);
        if (st != ILF_OK) return st;
    }
    if (point->glint_lobes && host->glint && s->of->balls) {
        ilf_scratch *m = borrow(s, 1, host->coef_bytes);

        if (!m) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for glints", s->of->field->path);
        ilf_light_glints(s, point, host, m->coef);
        give_back(s, m);
    }
    return ILF_OK;
}
