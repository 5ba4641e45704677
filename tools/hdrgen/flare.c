/*
 * flare.c - see flare.h.
 */
#include "flare.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "envelope.h"
#include "vision/spread.h"

enum { CELL = 8, KNOTS = 2, SMOOTH_LIGHT = KNOTS * KNOTS, PASSES = 2 };
static const double first_sd = 2, widest = 0.7; /* pixels; of the diagonal */
static const double own = 0.6;                  /* of the flare at a place, when a group's lamps make it */
static const int least_places = 20;
static const double least_share = 0.25, dark_share = 0.5; /* of places, that lie on the envelope */
static const double most_apart = 1.25;                    /* factor between what the groups say */
static const double least_gain = 3, least_pile = 30, pile_per_place = 0.03; /* of ln likelihood */
static const double most_total = 0.5, least_total = 1e-5;

int flare_is_certain(const flare_found *f)
{
    return f->verdict == FLARE_LAMPS || f->verdict == FLARE_DARK;
}

/* ---- places --------------------------------------------------------------------------------------- */

/* The darkest pixel of each cell, what the Gaussians of light put there, and smooth light of the scene's own.
 */
typedef struct places {
    int n, gaussians, unknowns;
    int *at;           /* [n] pixels */
    double *a, *value; /* as in envelope.h; the Gaussians first */
    unsigned char *bound, *dark, *half;
    double *curve, *rest, *own; /* [n] room */
    unsigned char *use;
    unsigned char may[ENVELOPE_MOST]; /* unknowns that may be above 0 */
} places;

static void places_free(places *s)
{
    free(s->at);
    free(s->a);
    free(s->value);
    free(s->bound);
    free(s->curve);
}

static int places_init(places *s, int most, int gaussians, errmsg *e)
{
    size_t n = (size_t)most;
    *s = (places){.gaussians = gaussians, .unknowns = gaussians + SMOOTH_LIGHT};
    s->at = malloc(n * sizeof *s->at);
    s->a = malloc(n * (size_t)s->unknowns * sizeof *s->a);
    s->value = malloc(n * sizeof *s->value);
    s->bound = malloc(4 * n);
    s->curve = malloc(3 * n * sizeof *s->curve);
    if (!s->at || !s->a || !s->value || !s->bound || !s->curve) return err_set(e, "flare: out of memory");
    s->dark = s->bound + n;
    s->half = s->dark + n;
    s->use = s->half + n;
    s->rest = s->curve + n;
    s->own = s->rest + n;
    return 0;
}

/* Mean over the 3 x 3 pixels around one that have data: noise would choose the darkest place otherwise. */
static double around(const flare_picture *p, int x, int y)
{
    double sum = 0, n = 0;
    for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < p->height; v++)
        for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < p->width; u++) {
            size_t i = (size_t)v * (size_t)p->width + (size_t)u;
            if (p->kind[i] == FLARE_NOTHING) continue;
            sum += (double)p->light[i];
            n++;
        }
    return n > 0 ? sum / n : 0;
}

static void choose(places *s, const flare_picture *p)
{
    for (int y0 = 0; y0 + CELL <= p->height; y0 += CELL)
        for (int x0 = 0; x0 + CELL <= p->width; x0 += CELL) {
            double least = INFINITY;
            int at = -1;
            for (int y = y0; y < y0 + CELL; y++)
                for (int x = x0; x < x0 + CELL; x++) {
                    double v = p->kind[y * p->width + x] == FLARE_NOTHING ? 0 : around(p, x, y);
                    if (v > 0 && v < least) {
                        least = v;
                        at = y * p->width + x;
                    }
                }
            if (at < 0) continue;
            s->at[s->n] = at;
            s->value[s->n] = least;
            s->bound[s->n] = p->kind[at] == FLARE_BOUND;
            s->dark[s->n] = p->dark && p->dark[at];
            s->half[s->n] = (unsigned char)((x0 / CELL + y0 / CELL) % 2);
            s->n++;
        }
}

/* Bilinear hats, in the unit of the places' mean value; none where no light of the scene falls. */
static void add_smooth_light(places *s, const flare_picture *p)
{
    double mean = 0;
    for (int i = 0; i < s->n; i++) mean += s->value[i] / s->n;
    for (int i = 0; i < s->n; i++)
        for (int k = 0; k < SMOOTH_LIGHT; k++) {
            double u = (double)(s->at[i] % p->width) / p->width * (KNOTS - 1);
            double v = (double)(s->at[i] / p->width) / p->height * (KNOTS - 1);
            double hat = fmax(1 - fabs(u - k % KNOTS), 0) * fmax(1 - fabs(v - k / KNOTS), 0);
            s->a[(long)i * s->unknowns + s->gaussians + k] = s->dark[i] ? 0 : mean * hat;
        }
}

/* ---- Gaussians of light ------------------------------------------------------------------------------ */

static int widths(double *sd, const flare_picture *p, int even)
{
    int n = 0;
    for (double s = first_sd; s <= widest * hypot(p->width, p->height) && n < FLARE_MOST - 1; s *= 2)
        sd[n++] = s;
    if (even) sd[n++] = 0;
    return n;
}

/* Light spread by width j: the Gaussian, or evenly over the picture. */
static int spread(float *to, const float *light, const flare_picture *p, double sd, errmsg *e)
{
    size_t n = (size_t)p->width * (size_t)p->height;
    double sum = 0;
    if (sd > 0) return vision_spread(to, light, p->width, p->height, sd, e);
    for (size_t i = 0; i < n; i++) sum += (double)light[i];
    for (size_t i = 0; i < n; i++) to[i] = (float)(sum / (double)n);
    return 0;
}

static int fill_places(places *s, float *maps, const float *scene, const flare_picture *p,
                       const flare_found *f, errmsg *e)
{
    size_t n = (size_t)p->width * (size_t)p->height;
    for (int j = 0; j < f->n; j++) {
        float *map = maps + (size_t)j * n;
        if (spread(map, scene, p, f->sd[j], e)) return -1;
        for (int i = 0; i < s->n; i++) s->a[(long)i * s->unknowns + j] = (double)map[s->at[i]];
    }
    return 0;
}

/* What one group's lamps alone scatter to the places. */
static int own_flare(places *s, float *room, const float *scene, const flare_picture *p, const flare_found *f,
                     const unsigned char *group, int which, errmsg *e)
{
    size_t n = (size_t)p->width * (size_t)p->height;
    float *light = room + n;
    for (size_t i = 0; i < n; i++) light[i] = group[i] == which ? scene[i] : 0;
    memset(s->own, 0, (size_t)s->n * sizeof *s->own);
    for (int j = 0; j < f->n; j++) {
        if (!(f->part[j] > 0)) continue;
        if (spread(room, light, p, f->sd[j], e)) return -1;
        for (int i = 0; i < s->n; i++) s->own[i] += f->part[j] * (double)room[s->at[i]];
    }
    return 0;
}

/* ---- verdict --------------------------------------------------------------------------------------- */

static envelope envelope_of(const places *s)
{
    return (envelope){s->n, s->unknowns, s->a, s->value, s->bound};
}

/* The flare, and the scene's smooth light, at the places by solution x. */
static void curves(places *s, const double *x)
{
    for (int i = 0; i < s->n; i++) {
        const double *a = s->a + (long)i * s->unknowns;
        s->curve[i] = s->rest[i] = 0;
        for (int j = 0; j < s->gaussians; j++) s->curve[i] += a[j] * x[j];
        for (int j = s->gaussians; j < s->unknowns; j++) s->rest[i] += a[j] * x[j];
    }
}

static void count(flare_found *f, const places *s)
{
    double sum = 0;
    for (int i = 0; i < s->n; i++) {
        double all = s->curve[i] + s->rest[i], d = log(s->value[i] / fmax(all, 1e-30));
        if (s->bound[i] || !(s->curve[i] > 0.5 * all) || !(fabs(d) < 0.15)) continue;
        f->on++;
        sum += d * d;
    }
    f->places = s->n;
    f->misfit = f->on ? sqrt(sum / f->on) : 0;
}

/* The fit to one half of the places, held against the other: how far its scale is off. */
static double held_out(places *s)
{
    double worst = 0, x[ENVELOPE_MOST];
    envelope p = envelope_of(s);
    for (int half = 0; half < 2; half++) {
        for (int i = 0; i < s->n; i++) s->use[i] = s->half[i] == half;
        envelope_fit(x, &p, s->use, s->may);
        curves(s, x);
        for (int i = 0; i < s->n; i++) s->use[i] = s->half[i] != half;
        worst = fmax(worst, fabs(envelope_rescale(&p, s->curve, s->rest, s->use).factor - 1));
    }
    return worst;
}

/* What two groups of lamps say, or the places where no light of the scene falls: the factor of the veil that
 * all of them bear out. */
static double borne_out(flare_found *f, const envelope_scale dark, const envelope_scale group[2])
{
    double low = fmin(group[0].factor, group[1].factor), high = fmax(group[0].factor, group[1].factor);
    int on = group[0].on < group[1].on ? group[0].on : group[1].on;
    if (dark.on >= least_places && dark.share >= dark_share) {
        f->verdict = FLARE_DARK;
        f->error = fmax(f->error, fabs(dark.factor - 1));
        return fmin(dark.factor, 1);
    }
    if (group[0].on < least_places && group[1].on < least_places) f->verdict = FLARE_NONE;
    else if (on < least_places) f->verdict = FLARE_ONE_LAMP;
    else if (fmin(group[0].share, group[1].share) < least_share || high > most_apart * low)
        f->verdict = FLARE_UNSETTLED;
    else {
        f->verdict = FLARE_LAMPS;
        f->error = fmax(f->error, high / low - 1);
    }
    return fmin(low, 1);
}

static int judge(flare_found *f, double *factor, places *s, const double *x, float *room, const float *scene,
                 const flare_picture *p, const unsigned char *group, errmsg *e)
{
    envelope v = envelope_of(s);
    envelope_scale said[2], dark;
    f->error = held_out(s);
    curves(s, x);
    count(f, s);
    dark = envelope_rescale(&v, s->curve, s->rest, s->dark);
    for (int k = 0; k < 2; k++) {
        if (own_flare(s, room, scene, p, f, group, k + 1, e)) return -1;
        for (int i = 0; i < s->n; i++) s->use[i] = !s->dark[i] && s->own[i] > own * s->curve[i];
        said[k] = envelope_rescale(&v, s->curve, s->rest, s->use);
    }
    *factor = borne_out(f, dark, said);
    if (f->total > most_total && flare_is_certain(f)) f->verdict = FLARE_UNSETTLED; /* no lens does that */
    if (!(f->total > least_total) ||
        (f->verdict != FLARE_DARK && f->pile_up < fmax(least_pile, pile_per_place * s->n)))
        f->verdict = FLARE_NONE;
    return 0;
}

/* The Gaussians from the narrowest on that values pile up on best: wider ones than these would only take up
 * smooth light of the scene.  x: their solution. */
static void select_widths(flare_found *f, double *x, places *s)
{
    double y[ENVELOPE_MOST], gain, best = 0, none = 0;
    envelope v = envelope_of(s);
    for (int k = 0; k <= s->gaussians; k++) {
        for (int j = 0; j < s->gaussians; j++) s->may[j] = j < k;
        envelope_fit(y, &v, NULL, s->may);
        gain = envelope_pile_up(&v, y);
        if (k == 0) none = best = gain;
        if (k > 0 && gain <= best + least_gain) continue;
        best = gain;
        f->used = k;
        memcpy(x, y, sizeof y);
    }
    f->pile_up = best - none;
    for (int j = 0; j < s->gaussians; j++) s->may[j] = j < f->used;
}

/* Part of a Gaussian that lies within the picture's width and height of its middle: further away nothing is
 * seen of it, and the fit says nothing. */
static double in_sight(double sd, const flare_picture *p)
{
    return sd > 0 ? erf(p->width / (sd * sqrt(2))) * erf(p->height / (sd * sqrt(2))) : 1;
}

/* The most that flare can be: all that is at the envelope. */
static double upper(places *s, const flare_found *f, const flare_picture *p)
{
    double x[ENVELOPE_MOST], sum = 0;
    envelope v = envelope_of(s);
    memset(s->may, 1, sizeof s->may);
    for (int i = 0; i < s->n; i++)
        for (int k = s->gaussians; k < s->unknowns; k++) s->a[(long)i * s->unknowns + k] = 0;
    envelope_fit(x, &v, NULL, s->may);
    for (int j = 0; j < s->gaussians; j++) sum += x[j] * in_sight(f->sd[j], p);
    return sum;
}

static void settle(flare_found *f, float *veil, const float *maps, const double *x, const flare_picture *p)
{
    size_t n = (size_t)p->width * (size_t)p->height;
    memset(veil, 0, n * sizeof *veil);
    f->total = 0;
    for (int j = 0; j < f->n; j++) {
        f->part[j] = x[j];
        f->total += x[j] * in_sight(f->sd[j], p);
        for (size_t i = 0; i < n && x[j] > 0; i++) veil[i] += (float)x[j] * maps[(size_t)j * n + i];
    }
}

static void scale(flare_found *f, float *veil, double by, size_t n)
{
    for (int j = 0; j < f->n; j++) f->part[j] *= by;
    f->total *= by;
    for (size_t i = 0; i < n; i++) veil[i] *= (float)by;
}

int flare_estimate(flare_found *out, float *veil, const flare_picture *p, const unsigned char *group,
                   const flare_found *like, errmsg *e)
{
    size_t n = (size_t)p->width * (size_t)p->height;
    int most = (p->width / CELL) * (p->height / CELL), dark = 0, bad = -1;
    flare_found f = {0};
    double x[ENVELOPE_MOST] = {0}, factor = 1;
    places s = {0};
    for (size_t i = 0; i < n && p->dark; i++) dark += p->dark[i] != 0;
    f.n = widths(f.sd, p, dark > 0);
    float *scene = malloc(n * sizeof *scene), *maps = malloc((size_t)(f.n + 2) * n * sizeof *maps);
    if (!scene || !maps) {
        err_set(e, "flare: out of memory for %dx%d pixels", p->width, p->height);
        goto done;
    }
    if (places_init(&s, most > 0 ? most : 1, f.n, e)) goto done;
    f.used = like ? like->used : f.n;
    f.pile_up = like ? like->pile_up : 0;
    for (int j = 0; j < s.unknowns; j++) s.may[j] = j < f.used || j >= f.n;
    memcpy(scene, p->light, n * sizeof *scene);
    choose(&s, p);
    add_smooth_light(&s, p);
    for (int pass = 0; pass < PASSES; pass++) {
        envelope v = envelope_of(&s);
        if (fill_places(&s, maps, scene, p, &f, e)) goto done;
        if (!like && !dark && pass + 1 == PASSES) select_widths(&f, x, &s);
        else envelope_fit(x, &v, NULL, s.may);
        settle(&f, veil, maps, x, p);
        for (size_t i = 0; i < n && pass + 1 < PASSES; i++)
            scene[i] = fmaxf(p->light[i] - veil[i], 0) / (float)(1 - fmin(f.total, most_total));
    }
    if (judge(&f, &factor, &s, x, maps, scene, p, group, e)) goto done;
    if (flare_is_certain(&f)) scale(&f, veil, factor, n);
    f.most = fmax(upper(&s, &f, p), f.total);
    *out = f;
    bad = 0;
done:
    places_free(&s);
    free(scene);
    free(maps);
    return bad;
}
