/*
 * contradict.c - see contradict.h.
 *
 * For exposures k < l of a pixel that are neighbours in time, both inside the scale, with y = finv(z),
 *
 *     d = ln(y_l / t_l) - ln(y_k / t_k),   var d = v(y_k)/y_k^2 + v(y_l)/y_l^2,
 *
 * is noise alone where nothing moved and response and times are right.  How much larger than the model's
 * noise it usually is in this series is learnt from medians, by brightness, which a minority of things
 * that move can't spoil.
 */
#include "contradict.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LEVELS = 12, FEW = 40, MANY = 2000 };

static const double too_far = 5;       /* of what is usual */
static const double always = 0.12;     /* ln: flicker, small shifts, errors of the curve */
static const double most_above = 3;    /* no level's usual is above this many times the whole series' */
static const double well_known = 0.25; /* relative deviation: samples known worse contradict nothing */

typedef struct pairing {
    const samples *s;
    const double *lnt;
    int c;
    double *ln_y, *sd;    /* [max_code + 1] ln finv and its relative deviation */
    unsigned char *level; /* [max_code + 1] */
} pairing;

static void pairing_free(pairing *p)
{
    free(p->ln_y);
    free(p->sd);
    free(p->level);
}

static int pairing_init(pairing *p, const samples *s, int c, const response *r, const noise_model *m,
                        const double *lnt)
{
    size_t n = (size_t)s->max_code + 1;
    *p = (pairing){.s = s, .lnt = lnt, .c = c};
    p->ln_y = malloc(n * sizeof *p->ln_y);
    p->sd = malloc(n * sizeof *p->sd);
    p->level = malloc(n);
    if (!p->ln_y || !p->sd || !p->level) return -1;
    double top = r->finv[c][r->clip[c]];
    for (int z = 1; z <= s->max_code; z++) {
        double y = r->finv[c][z];
        p->ln_y[z] = log(y);
        p->sd[z] = sqrt(noise_variance(m, y, response_slope(r, c, z))) / y;
        int level = LEVELS - 1 + (int)floor(log2(y / top));
        p->level[z] = (unsigned char)(level < 0 ? 0 : level >= LEVELS ? LEVELS - 1 : level);
    }
    return 0;
}

static int inside(const pairing *p, int z)
{
    return z > 0 && z < p->s->clip[p->c] && z < p->s->max_code && p->sd[z] < well_known;
}

/* The next pair of sample i: 1 with d and its deviation by the model, 0 when there is none.  *k and *l: -1
 * at first. */
static int next_pair(const pairing *p, int i, int *k, int *l, double *d, double *sd)
{
    const uint16_t *z = p->s->z[p->c] + (size_t)i * (size_t)p->s->exposures;
    int at = *l < 0 ? 0 : *l, n = p->s->exposures;
    while (at < n && !inside(p, z[at])) at++;
    int next = at + 1;
    while (next < n && !inside(p, z[next])) next++;
    if (next >= n) return 0;
    *k = at;
    *l = next;
    *d = p->ln_y[z[next]] - p->lnt[next] - p->ln_y[z[at]] + p->lnt[at];
    *sd = hypot(p->sd[z[next]], p->sd[z[at]]);
    return 1;
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double median(float *v, int n)
{
    if (n == 0) return 0;
    qsort(v, (size_t)n, sizeof *v, by_value);
    return (double)v[n / 2];
}

/* What |d| / sd usually is, by the level of the shorter exposure's sample, as the deviation of a normal
 * distribution. */
static int usual(double q[LEVELS], const pairing *p)
{
    static const double normal = 0.6745; /* median of |x| */
    size_t most = (size_t)p->s->n[p->c] * (size_t)p->s->exposures;
    float *v = malloc((most + 1) * sizeof *v), *part = malloc((most + 1) * sizeof *part);
    unsigned char *level = malloc(most + 1);
    int n = 0;
    int every =
        p->s->n[p->c] > MANY ? p->s->n[p->c] / MANY : 1; /* medians of so many are known well enough */
    for (int i = 0; v && part && level && i < p->s->n[p->c]; i += every) {
        int k = -1, l = -1;
        double d, sd;
        const uint16_t *z = p->s->z[p->c] + (size_t)i * (size_t)p->s->exposures;
        while (next_pair(p, i, &k, &l, &d, &sd)) {
            level[n] = p->level[z[k]];
            v[n++] = (float)(fabs(d) / sd);
        }
    }
    int bad = !v || !part || !level;
    if (!bad) {
        memcpy(part, v, (size_t)n * sizeof *v);
        double all = fmax(median(part, n) / normal, 1);
        for (int b = 0; b < LEVELS; b++) {
            int m = 0;
            for (int i = 0; i < n; i++)
                if (level[i] == b) part[m++] = v[i];
            q[b] = m < FEW ? all : fmin(fmax(median(part, m) / normal, 1), most_above * all);
        }
    }
    free(v);
    free(part);
    free(level);
    return bad ? -1 : 0;
}

static int mark_channel(samples *s, int c, const response *r, const noise_model *m, const double *lnt)
{
    pairing p;
    double q[LEVELS];
    int bad = pairing_init(&p, s, c, r, m, lnt) || usual(q, &p);
    for (int i = 0; !bad && i < s->n[c]; i++) {
        int k = -1, l = -1;
        double d, sd;
        const uint16_t *z = s->z[c] + (size_t)i * (size_t)s->exposures;
        while (next_pair(&p, i, &k, &l, &d, &sd))
            if (fabs(d) > always + too_far * q[p.level[z[k]]] * sd) s->out[c][i] = 1;
    }
    pairing_free(&p);
    return bad;
}

int contradict_mark(samples *s, const response *r, const noise_model *noise, const double *lnt, errmsg *e)
{
    int together = 1; /* the channels' samples are of the same pixels */
    for (int c = 0; c < s->channels; c++) {
        memset(s->out[c], 0, (size_t)s->n[c]);
        together &= s->n[c] == s->n[0] && !s->mosaic;
    }
    for (int c = 0; c < s->channels; c++)
        if (mark_channel(s, c, r, &noise[c], lnt))
            return err_set(e, "out of memory for %d sample pixels", s->n[c]);
    for (int i = 0; together && s->channels == 3 && i < s->n[0]; i++)
        s->out[0][i] = s->out[1][i] = s->out[2][i] = s->out[0][i] | s->out[1][i] | s->out[2][i];
    return 0;
}

/* ---- the series as a whole
 * ------------------------------------------------------------------------------ */

enum { GRID = 16, STEEP = 3 };

typedef struct sums {
    double square, var, pixels, differ; /* over pairs; pixels that have one, and that differ */
    double cell[GRID * GRID], cell_n[GRID * GRID];
    double steep[STEEP], steep_n[STEEP]; /* square less noise, by steepness: flat, between, steep */
    float *d;                            /* [kk * most] differences of neighbours k, k+1 */
    int *n, most;                        /* [kk] */
} sums;

static void add_pixel(sums *t, const pairing *p, int i, const float limit[2])
{
    static const double quarter = 0.25 * M_LN2, most = 2 * M_LN2, sigmas = 4;
    const samples *s = p->s;
    int k = -1, l = -1, any = 0, differ = 0;
    int class = s->steep[p->c][i] < limit[0] ? 0 : s->steep[p->c][i] < limit[1] ? 1 : 2;
    double d, sd;
    while (next_pair(p, i, &k, &l, &d, &sd)) {
        double cut = fmin(fabs(d), most);
        any = 1;
        differ |= fabs(d) > quarter + sigmas * sd;
        t->square += cut * cut;
        t->var += sd * sd;
        t->steep[class] += cut * cut - sd * sd;
        t->steep_n[class]++;
        if (l == k + 1 && t->n[k] < t->most) t->d[k * t->most + t->n[k]++] = (float)d;
    }
    if (!any) return;
    int x = (int)(s->at[p->c][i] % (uint32_t)s->width), y = (int)(s->at[p->c][i] / (uint32_t)s->width);
    int cell = (int)((int64_t)y * GRID / s->height) * GRID + (int)((int64_t)x * GRID / s->width);
    t->pixels++;
    t->differ += differ;
    t->cell[cell] += differ;
    t->cell_n[cell]++;
}

/* Part of what differs that lies in cells most of which differ, if those are a small part of the picture. */
static double in_few_places(const sums *t)
{
    static const double dense = 0.4, small = 0.3;
    double all = 0, there = 0, cells = 0, used = 0;
    for (int i = 0; i < GRID * GRID; i++) {
        int full = t->cell[i] > dense * t->cell_n[i];
        all += t->cell[i];
        there += full ? t->cell[i] : 0;
        cells += full;
        used += t->cell_n[i] > 0;
    }
    return all > 0 && cells < small * used ? there / all : 0;
}

/* Exposure that is off by a factor: brighter than both neighbours or darker than both, by the medians. */
static int odd_one(sums *t, int kk, double *off, double *spread)
{
    int at = -1;
    double last = 0;
    *off = *spread = 0;
    for (int k = 0; k + 1 < kk; k++) {
        double d = t->n[k] >= FEW ? median(t->d + k * t->most, t->n[k]) / M_LN2 : 0;
        *spread = fmax(*spread, fabs(d));
        if (k > 0 && d * last < 0 && fmin(fabs(d), fabs(last)) > fabs(*off)) {
            *off = last > 0 ? fmin(last, -d) : fmax(last, -d);
            at = k;
        }
        last = d;
    }
    return at;
}

static void find_cause(contradict_facts *f, sums *t, int kk)
{
    static const double concentrated = 0.55, edges = 3, factor = 0.2, shifts = 0.25;
    double spread, flat = t->steep_n[0] > 0 ? fmax(t->steep[0] / t->steep_n[0], 1e-6) : 1;
    double steep = t->steep_n[2] > 0 ? t->steep[2] / t->steep_n[2] : 0;
    f->exposure = odd_one(t, kk, &f->off, &spread);
    f->cause = in_few_places(t) > concentrated             ? CAUSE_REGION
               : steep > edges * flat                      ? CAUSE_CAMERA
               : f->exposure >= 0 && fabs(f->off) > factor ? CAUSE_EXPOSURE
               : spread > shifts                           ? CAUSE_CURVE
                                                           : CAUSE_UNKNOWN;
}

/* Moves the differences together: the last thing that is done with them. */
static double usual_difference(sums *t, int kk)
{
    int n = 0;
    for (int k = 0; k < kk; k++)
        for (int i = 0; i < t->n[k]; i++) t->d[n++] = fabsf(t->d[k * t->most + i]);
    return median(t->d, n) / 0.6745;
}

int contradict_matters(const contradict_facts *f)
{
    static const double most = 0.35, of_many = 0.15, many = 0.25;
    return f->pairs > FEW && (f->stops > most || (f->stops > of_many && f->share > many));
}

static int measure_channel(sums *t, const samples *s, int c, const response *r, const noise_model *m,
                           const double *lnt)
{
    /* a fit to exposures that contradict each other takes the contradiction for noise: no camera has more
     * than this */
    noise_model least = {fmin(m->photon, 1.0 / 500), fmin(m->read, 3.0 / 500), fmin(m->code_var, 30)};
    pairing p;
    float *steep = malloc(((size_t)s->n[c] + 1) * sizeof *steep), limit[2] = {0};
    int bad = pairing_init(&p, s, c, r, &least, lnt) || !steep;
    int every = s->n[c] > 6 * MANY ? s->n[c] / (6 * MANY) : 1, n = 0;
    for (int i = 0; !bad && i < s->n[c]; i += every) steep[n++] = s->steep[c][i];
    if (n > 0) {
        qsort(steep, (size_t)n, sizeof *steep, by_value);
        limit[0] = steep[n / 3];
        limit[1] = steep[n - n / 6 - 1];
    }
    for (int i = 0; !bad && i < s->n[c]; i += every) add_pixel(t, &p, i, limit);
    pairing_free(&p);
    free(steep);
    return bad;
}

int contradict_measure(contradict_facts *f, const samples *s, const response *r, const noise_model *noise,
                       const double *lnt, errmsg *e)
{
    sums t = {.most = MANY};
    int bad = 0;
    t.d = malloc(sizeof *t.d * (size_t)t.most * (size_t)s->exposures);
    t.n = calloc((size_t)s->exposures, sizeof *t.n);
    memset(f, 0, sizeof *f);
    f->exposure = -1;
    for (int c = 0; c < s->channels && !bad; c++)
        bad = !t.d || !t.n || measure_channel(&t, s, c, r, &noise[c], lnt);
    if (!bad && t.pixels > 0) {
        double pairs = t.steep_n[0] + t.steep_n[1] + t.steep_n[2];
        f->stops = sqrt(fmax(t.square - t.var, 0) / pairs) / M_LN2;
        f->share = t.differ / t.pixels;
        f->pairs = (int)pairs;
        find_cause(f, &t, s->exposures);
        f->usual = usual_difference(&t, s->exposures);
    }
    free(t.d);
    free(t.n);
    return bad ? err_set(e, "out of memory for the comparison of %d exposures", s->exposures) : 0;
}
