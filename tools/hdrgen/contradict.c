/*
 * contradict.c - see contradict.h.
 *
 * For exposures k < l of a pixel that are neighbours in time, both inside the scale, with y = finv(z),
 *
 *     d = ln(y_l / t_l) - ln(y_k / t_k),   var d = v(y_k)/y_k^2 + v(y_l)/y_l^2,
 *
 * is noise alone where nothing moved and response and times are right.  How much larger than the model's noise it
 * usually is in this series is learnt from medians, by brightness, which a minority of things that move can't spoil.
 */
#include "contradict.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LEVELS = 12, FEW = 40 };

static const double too_far = 5;        /* of what is usual */
static const double always = 0.12;      /* ln: flicker, small shifts, errors of the curve */
static const double most_above = 3;     /* no level's usual is above this many times the whole series' */
static const double well_known = 0.25;  /* relative deviation: samples known worse contradict nothing */

typedef struct pairing {
    const samples *s;
    const double *lnt;
    int c, level_of_code_n;
    double *ln_y, *sd;       /* [max_code + 1] ln finv and its relative deviation */
    unsigned char *level;    /* [max_code + 1] */
} pairing;

static void pairing_free(pairing *p)
{
    free(p->ln_y);
    free(p->sd);
    free(p->level);
}

static int pairing_init(pairing *p, const samples *s, int c, const response *r, const noise_model *m, const double *lnt)
{
    size_t n = (size_t)s->max_code + 1;
    *p = (pairing){.s = s, .lnt = lnt, .c = c};
    p->ln_y = malloc(n * sizeof *p->ln_y);
    p->sd = malloc(n * sizeof *p->sd);
    p->level = malloc(n);
    if (!p->ln_y || !p->sd || !p->level)
        return -1;
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

/* The next pair of sample i: 1 with d (ln, less the dark frame's part that is left to the caller's threshold) and its
 * deviation by the model; 0 when there is none.  *k and *l: -1 at first. */
static int next_pair(const pairing *p, int i, int *k, int *l, double *d, double *sd)
{
    const uint16_t *z = p->s->z[p->c] + (size_t)i * (size_t)p->s->exposures;
    int at = *l < 0 ? 0 : *l, n = p->s->exposures;
    while (at < n && !inside(p, z[at]))
        at++;
    int next = at + 1;
    while (next < n && !inside(p, z[next]))
        next++;
    if (next >= n)
        return 0;
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
    if (n == 0)
        return 0;
    qsort(v, (size_t)n, sizeof *v, by_value);
    return (double)v[n / 2];
}

/* What |d| / sd usually is, by the level of the shorter exposure's sample, as the deviation of a normal distribution. */
static int usual(double q[LEVELS], const pairing *p)
{
    static const double normal = 0.6745; /* median of |x| */
    size_t most = (size_t)p->s->n[p->c] * (size_t)p->s->exposures;
    float *v = malloc((most + 1) * sizeof *v), *part = malloc((most + 1) * sizeof *part);
    unsigned char *level = malloc(most + 1);
    int n = 0;
    for (int i = 0; v && part && level && i < p->s->n[p->c]; i++) {
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
                if (level[i] == b)
                    part[m++] = v[i];
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
            if (fabs(d) > always + too_far * q[p.level[z[k]]] * sd)
                s->out[c][i] = 1;
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
