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

#include "ilf_lighting.h"

/* Below this share of a point's light a lamp is traced now and then only, when its turn comes. */
#define SMALL_SHARE (1.0 / 256)

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

/* ---- candidates ------------------------------------------------------------------------------- */

static int choose_numbers(lighting *l)
{
    l->rays = ilf_full_rays(l->at);
    l->candidates = ilf_slice_candidates(l);
    int n = l->candidates;
    for (int k = 0; k < l->s->of->field->n_lamps; k++) n += ilf_lamp_candidates(l, k);
    return n;
}

static ilf_status draw_candidates(lighting *l, ilf_error *err)
{
    const ilf_host *h = l->host;
    const int lamps = l->s->of->field->n_lamps;

    ilf_lamp_point(l->at_lamps, l->s->of->field, &l->s->of->frame, l->at->position);
    ilf_status st = l->candidates ? ilf_draw_from_slice(l, err) : ILF_OK;
    if (!lamps || st != ILF_OK) return st;
    double u = h->random(ILF_IN_LAMP, h->context);
    for (int k = 0; k < lamps && st == ILF_OK; k++) {
        u += STEP_V, u -= u >= 1;
        st = ilf_draw_for_lamp(l, k, u, err);
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
