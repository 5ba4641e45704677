/*
 * ilf_numbers.c - how many candidates are drawn and how many rays are traced at a point, by what earlier points
 * in its cube of space met.
 */
#include "ilf_lighting.h"

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

/* Their error is balanced with that of so many rays at least: one ray of an unhidden lamp has no error. */
#define FEWEST_BALANCED 4

/* Points in a cube before a lamp's weights count as known. */
#define BELIEVED_POINTS 16

int ilf_full_rays(const ilf_point *p)
{
    const int rays = (int)(p->samples * p->weight + 0.999);

    return rays < 1 ? 1 : rays > p->samples ? p->samples : rays;
}

static int is_believed(const slice_past *past, const ilf_point *p)
{
    return past->tests >= BELIEVED_TESTS && past->mean2 > 0 && !p->narrow;
}

double ilf_rays_kept(const slice_past *past, const ilf_point *p)
{
    const int same = past->visible <= 0 || past->visible >= past->tests;

    return is_believed(past, p) && same ? 1.0 / FEWER_IF_SURE : 1;
}

static double deviation(const slice_past *past)
{
    return CANDIDATES_PER_DEVIATION * sqrt(past->var / past->mean2);
}

int ilf_slice_candidates(const lighting *l)
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

int ilf_lamp_candidates(const lighting *l, int k)
{
    const ilf_point *p = l->at;
    const slice_past *past = &l->slice->lamp_past[k];
    double n = p->narrow ? MOST_LAMP_CANDIDATES : LAMP_CANDIDATES;

    if (past->points >= BELIEVED_POINTS && !p->narrow)
        n = past->mean2 > 0 ? fmin(fmax(l->rays, FEWEST_BALANCED) * deviation(past), MOST_LAMP_CANDIDATES)
                            : 0;
    n *= p->weight;
    return n > LEAST_LAMP_CANDIDATES ? (int)n : LEAST_LAMP_CANDIDATES;
}
