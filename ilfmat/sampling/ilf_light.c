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
 * Lamps that were taken out of the field are aimed at one by one: the candidates of each spread evenly over the
 * solid angle that it fills.  Directions are divided, so that nothing counts twice: one that meets a lamp is the
 * first such lamp's, all others are the slice's; with N candidates of a lamp and M of the slice, w / N stands
 * beside w / M.
 *
 * The number of rays goes with the point's weight, and falls where earlier tests in the same cube of space
 * all had the same result.  So many candidates are drawn that their part of the error costs no more than the
 * rays' part: with the root of the weights' variance, as earlier points in the cube had it.  These tests and
 * points are others, so that the mean stays right.
 */
#include <stdlib.h>

#include "ilf_sampler.h"
#include "ilf_vec.h"

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

/* Candidates of one lamp: for a point that counts in full, before its weights are known and at most; and for
 * any. */
#define LAMP_CANDIDATES       16
#define MOST_LAMP_CANDIDATES  64
#define LEAST_LAMP_CANDIDATES 4

/* Below this share of a point's light a lamp is traced now and then only, when its turn comes. */
#define SMALL_SHARE (1.0 / 256)

/* Points in a cube before a lamp's weights count as known. */
#define BELIEVED_POINTS 16

/* Part of the map's expectation that is added to the estimate.  More sends rays where nothing is. */
#define DOUBT 0.01

/* Steps of an additive recurrence that fills the square evenly: 1/g and 1/g^2, g^3 = g + 1 (M. Roberts, "The
 * Unreasonable Effectiveness of Quasirandom Sequences", 2018). */
#define STEP_V 0.75487766624669276
#define STEP_W 0.56984029099805327

typedef struct candidate {
    double dir[3];
    double target; /* f X: its chance is that over pdf */
    double weight; /* target / pdf; of a lamp's candidate as if it had been one of as many as the slice has */
    slice_past *past; /* of what it is aimed at: a lamp, or the slice */
    double keep;      /* part of its rays that is traced */
    int times, seen;  /* chosen; and found light */
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
    double at_lamps[3];   /* the point in the lamps' coordinates */
    int candidates, rays; /* to draw from the slice, to trace */
    int n;                /* candidates that count */
    double sum, sum2;     /* of the slice's weights, and of the weights' squares */
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

static int full_rays(const ilf_point *p)
{
    const int rays = (int)(p->samples * p->weight + 0.999);

    return rays < 1 ? 1 : rays > p->samples ? p->samples : rays;
}

static int is_believed(const slice_past *past, const ilf_point *p)
{
    return past->tests >= BELIEVED_TESTS && past->mean2 > 0 && !p->narrow;
}

/* The part of its rays that is traced. */
static double kept(const slice_past *past, const ilf_point *p)
{
    const int same = past->visible <= 0 || past->visible >= past->tests;

    return is_believed(past, p) && same ? 1.0 / FEWER_IF_SURE : 1;
}

static double deviation(const slice_past *past)
{
    return CANDIDATES_PER_DEVIATION * sqrt(past->var / past->mean2);
}

static int slice_candidates(const lighting *l)
{
    const ilf_point *p = l->at;
    const slice_past *past = &l->slice->past;
    const int rays = l->rays, fewer = (rays + FEWER_IF_SURE - 1) / FEWER_IF_SURE;
    int n = rays * MOST_CANDIDATES;

    if (l->slice->cells == 0) return 0;
    if (is_believed(past, p)) {
        const double d = deviation(past);

        if (d < MOST_CANDIDATES) n = (int)(rays * (d > FEWEST_CANDIDATES ? d : FEWEST_CANDIDATES));
        if (past->visible <= 0 && n > fewer * MOST_CANDIDATES) n = fewer * MOST_CANDIDATES;
    }
    if (n < SEEN_CANDIDATES * p->weight) n = (int)(SEEN_CANDIDATES * p->weight);
    return n < LEAST_CANDIDATES ? LEAST_CANDIDATES : n;
}

static int lamp_candidates(const lighting *l, int k)
{
    const ilf_point *p = l->at;
    const slice_past *past = &l->slice->lamp_past[k];
    double n = p->narrow ? MOST_LAMP_CANDIDATES : LAMP_CANDIDATES;

    if (past->points >= BELIEVED_POINTS && !p->narrow)
        n = past->mean2 > 0 ? fmin(l->rays * deviation(past), MOST_LAMP_CANDIDATES) : 0;
    n *= p->weight;
    return n > LEAST_LAMP_CANDIDATES ? (int)n : LEAST_LAMP_CANDIDATES;
}

static int choose_numbers(lighting *l)
{
    l->rays = full_rays(l->at);
    l->candidates = slice_candidates(l);
    int n = l->candidates;
    for (int k = 0; k < l->s->of->field->n_lamps; k++) n += lamp_candidates(l, k);
    return n;
}

/* ---- candidates ------------------------------------------------------------------------------- */

/* Luminance of the texels' excess towards dir, for light that is about `dist` away; nothing is traced. */
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
        ilf_eval_residual(rgb, p->field, &p->frame, NULL, dir, hit, near ? ILF_DEPTH : ILF_NO_DEPTH, err);

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

/* Where the rays from the point in a direction (lamps' coordinates) begin, as far as lamps are concerned. */
static void lamp_origin(double o[3], const lighting *l, const double d[3])
{
    const double down = l->s->of->mode == ILF_DEPTH ? 0 : l->at_lamps[2] / d[2];

    for (int c = 0; c < 3; c++) o[c] = l->at_lamps[c] - down * d[c];
}

/* Does the direction belong to a lamp rather than to the slice? */
static int meets_lamp(const lighting *l, const double dir[3])
{
    const ilf *f = l->s->of->field;
    const ilf_frame *fr = &l->s->of->frame;
    const double d[3] = {dot(dir, fr->u), dot(dir, fr->v), dot(dir, fr->n)};
    double o[3];

    if (f->n_lamps == 0 || !(d[2] > 0)) return 0;
    lamp_origin(o, l, d);
    return ilf_nearest_lamp(f, o, d, HUGE_VAL) >= 0;
}

static void to_world(double dir[3], const ilf_frame *fr, const double d[3])
{
    for (int a = 0; a < 3; a++) dir[a] = d[0] * fr->u[a] + d[1] * fr->v[a] + d[2] * fr->n[a];
}

static ilf_status draw_from_slice(lighting *l, ilf_error *err)
{
    const ilf_host *h = l->host;
    const double u = h->random(ILF_ALONG_MAP, h->context);
    double v = h->random(ILF_IN_CELL_U, h->context), w = h->random(ILF_IN_CELL_V, h->context);
    const double keep = kept(&l->slice->past, l->at);

    for (int k = 0; k < l->candidates; k++) {
        candidate *c = &l->mem->c[l->n];
        void *coef = l->mem->coef + (size_t)l->n * h->coef_bytes;
        ilf_draw dr;

        v += STEP_V, v -= v >= 1;
        w += STEP_W, w -= w >= 1;
        ilf_sample(&dr, l->slice, (k + u) / l->candidates, v, w);
        to_world(c->dir, &l->s->of->frame, dr.dir);
        const double f = h->lobe(coef, c->dir, l->at->lobes, h->context);
        double excess;
        if (!(f > 0) || meets_lamp(l, c->dir)) continue;
        const ilf_status st = estimate(&excess, l, c->dir, &dr, err);
        if (st != ILF_OK) return st;
        c->target = f * excess;
        if (!(c->target > 0)) continue;
        c->weight = c->target / dr.pdf;
        c->past = &l->slice->past;
        c->keep = keep;
        l->sum += c->weight;
        l->sum2 += c->weight * c->weight;
        l->n++;
    }
    l->s->work.candidates += l->candidates;
    return ILF_OK;
}

/* ---- candidates of lamps ---------------------------------------------------------------------- */

/* Every second bit of x, from the lowest, as a fraction of 1. */
static double every_second_bit(uint32_t x)
{
    x &= 0x55555555u;
    x = (x | x >> 1) & 0x33333333u;
    x = (x | x >> 2) & 0x0f0f0f0fu;
    x = (x | x >> 4) & 0x00ff00ffu;
    x = (x | x >> 8) & 0x0000ffffu;
    return (x + 0.5) * 0x1p-16;
}

/* The place in the unit square of a number in [0, 1), along Morton's curve. */
static void along_curve(double st[2], double x)
{
    const uint32_t m = (uint32_t)(x * 0x1p32);

    st[0] = every_second_bit(m);
    st[1] = every_second_bit(m >> 1);
}

/* The excess towards a lamp at its candidate: exactly, but for what the residual has behind it.  Above 0
 * wherever the ray that is traced may find some. */
static ilf_status lamp_excess(double *excess, const lighting *l, const ilf_luminaire *lamp, const double o[3],
                              const double d[3], const double dir[3], ilf_error *err)
{
    const double T = l->s->of->threshold, pass = ilf_luminaire_pass(lamp, o, d);

    *excess = pass * fmax(ilf_luminance(lamp->rgb), 0) + fmin(pass, 1) * T;
    if (l->slice->cells == 0) return ILF_OK;
    double behind, t = HUGE_VAL;
    ilf_luminaire_hit(&t, lamp, o, d);
    const double unit = l->s->of->frame.len_u / l->s->of->field->frame.len_u;
    const ilf_status st = excess_at(&behind, l, dir, t * unit, err);
    if (st == ILF_OK) *excess += behind + DOUBT * T;
    return st;
}

static ilf_status draw_for_lamp(lighting *l, int k, double u, ilf_error *err)
{
    const ilf_patches *p = l->s->of;
    const ilf_luminaire *lamp = &p->field->lamps[k];
    const int n = lamp_candidates(l, k), below = p->mode != ILF_DEPTH && lamp->centre[2] < l->at_lamps[2];
    slice_past *past = &l->slice->lamp_past[k];
    const double share = (double)(l->candidates > 0 ? l->candidates : 1) / n, keep = kept(past, l->at);
    double sum = 0, sum2 = 0;

    for (int i = 0; i < n; i++) {
        candidate *c = &l->mem->c[l->n];
        void *coef = l->mem->coef + (size_t)l->n * l->host->coef_bytes;
        double st[2], o[3], d[3], excess;

        along_curve(st, (i + u) / n);
        const double pdf = ilf_luminaire_sample(d, lamp, l->at_lamps, st[0], st[1]);
        if (!(pdf > 0)) continue;
        for (int a = 0; a < 3 && below; a++)
            d[a] = -d[a]; /* the ray's line goes through it, before the point */
        if (!(d[2] > 0)) continue;
        lamp_origin(o, l, d);
        if (ilf_nearest_lamp(p->field, o, d, HUGE_VAL) != k) continue;
        to_world(c->dir, &p->frame, d);
        const double f = l->host->lobe(coef, c->dir, l->at->lobes, l->host->context);
        if (!(f > 0)) continue;
        const ilf_status ok = lamp_excess(&excess, l, lamp, o, d, c->dir, err);
        if (ok != ILF_OK) return ok;
        c->target = f * excess;
        if (!(c->target > 0)) continue;
        c->weight = c->target / pdf * share;
        c->past = past;
        c->keep = keep;
        sum += c->weight;
        sum2 += c->weight * c->weight;
        l->n++;
    }
    l->s->work.candidates += n;
    if (!l->at->narrow && !l->at->apart) {
        const double mean = sum / n;
        past->points++;
        past->mean2 += mean * mean;
        past->var += sum2 / n - mean * mean;
    }
    return ILF_OK;
}

static ilf_status draw_candidates(lighting *l, ilf_error *err)
{
    const ilf_host *h = l->host;
    const int lamps = l->s->of->field->n_lamps;
    ilf_status st = l->candidates ? draw_from_slice(l, err) : ILF_OK;

    if (!lamps || st != ILF_OK) return st;
    ilf_lamp_point(l->at_lamps, l->s->of->field, &l->s->of->frame, l->at->position);
    double u = h->random(ILF_IN_LAMP, h->context);
    for (int k = 0; k < lamps && st == ILF_OK; k++) {
        u += STEP_V, u -= u >= 1;
        st = draw_for_lamp(l, k, u, err);
    }
    return st;
}

/* ---- rays ------------------------------------------------------------------------------------- */

/* Choose of candidates [first, end), all of one stratum, by weight, in steps along it, and trace.  chance is
 * that of the stratum to be traced at all. */
static void trace_chosen(const lighting *l, int first, int end, double sum, int rays, double start,
                         double chance)
{
    const ilf_host *h = l->host;
    const double step = sum / rays, draws = l->candidates > 0 ? l->candidates : 1;
    double next = step * start, passed = 0;

    for (int k = first; k < end; k++) {
        candidate *c = &l->mem->c[k];

        c->times = 0;
        passed += c->weight;
        for (; next < passed; next += step) c->times++;
        if (!c->times) continue;
        const ilf_aim aim = {c->dir, l->mem->coef + (size_t)k * h->coef_bytes,
                             c->times * step / (chance * draws * c->target)};
        c->seen = h->shadow(&aim, h->context);
        l->s->work.rays++;
    }
}

/* Each stratum gets its share of the rays, and one at least, so that lamps of many colours don't make coloured
 * noise; but very small shares are traced now and then only. */
static void trace_strata(const lighting *l)
{
    double all = 0;

    for (int k = 0; k < l->n; k++) all += l->mem->c[k].weight;
    for (int first = 0, end; first < l->n; first = end) {
        const candidate *c = &l->mem->c[first];
        double sum = 0, start = l->host->random(ILF_CHOICE, l->host->context);

        for (end = first; end < l->n && l->mem->c[end].past == c->past; end++) sum += l->mem->c[end].weight;
        const double chance = fmin(1, sum / (SMALL_SHARE * all));
        if (start >= chance) {
            for (int k = first; k < end; k++) l->mem->c[k].times = 0;
            continue;
        }
        trace_chosen(l, first, end, sum, (int)ceil(l->rays * c->keep * (sum / all)), start / chance, chance);
    }
}

/* For adapting the numbers at later points of the cube. */
static void remember(const lighting *l)
{
    slice_past *past = &l->slice->past;
    const double mean = l->candidates ? l->sum / l->candidates : 0;

    for (int k = 0; k < l->n; k++) {
        const candidate *c = &l->mem->c[k];

        if (!c->times) continue;
        c->past->tests += c->times;
        if (c->seen) c->past->visible += c->times;
    }
    if (l->at->narrow || !l->candidates) return;
    past->mean2 += mean * mean;
    past->var += l->sum2 / l->candidates - mean * mean;
}

static ilf_status light_straight(lighting *l, ilf_error *err)
{
    l->mem = borrow(l->s, choose_numbers(l), l->host->coef_bytes);
    if (!l->mem) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for candidates", l->s->of->field->path);
    const ilf_status st = draw_candidates(l, err);
    if (st == ILF_OK && l->n) {
        l->s->busy++;
        trace_strata(l);
        l->s->busy--;
        if (!l->at->apart) remember(l);
    }
    give_back(l->s, l->mem);
    return st;
}

/* The cube around the point, or NULL where nothing can be bright. */
static ilf_status find_cube(lighting *l, ilf_error *err)
{
    if (l->s->of->field->n_lamps) return ilf_sampler_cube(&l->slice, l->s, l->at->position, err);
    return ilf_sampler_slice(&l->slice, l->s, l->at->position, err);
}

ilf_status ilf_light(ilf_sampler *s, const ilf_point *point, const ilf_host *host, ilf_error *err)
{
    lighting l = {.s = s, .at = point, .host = host};

    if (ilf_patches_count(s->of) == 0) return ILF_OK;
    if (point->lobes) {
        ilf_status st = find_cube(&l, err);

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
