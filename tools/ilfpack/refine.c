/*
 * refine.c - see refine.h.
 */
#include "refine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/blobs.h"
#include "ilflamps/vec.h"

enum { FEWEST = 4, MOST = 200 };
#define BRIGHT 15. /* times the typical luminance: no wall */
#define PLACES .02 /* what is given is about so sure: sizes of the plane, */
#define TURNS  .02 /* radians, */
#define GAINS  .05 /* relative */
#define HELPS  .85 /* part of the pictures' disagreement that must be left at most */
#define SURELY 4.  /* standard errors that a correction must have, rms */

static double typical(const lightfield *f)
{
    double sum = 0;

    for (int k = 0; k < f->n; k++) sum += blobs_median(f, k) / f->n;
    return sum;
}

static int find_landmarks(landmarks *l, const char *octree, const lightfield *f, errmsg *e)
{
    surroundings s;

    if (octree) return landmarks_trace(l, octree, f, e);
    if (surroundings_guess(&s, f, e)) return -1;
    const int bad = landmarks_box(l, &s, f, e);
    surroundings_free(&s);
    return bad;
}

/* Rms of corrections, and in their standard errors. */
static double summarise(refined *r, int n)
{
    double sum[3] = {0}, sure = 0;

    for (int k = 0; k < n; k++) {
        const pose *p = &r->found.p[k];
        for (int c = 0; c < POSE; c++) sum[c / 3] += p->change[c] * p->change[c] / n;
        for (int c = 0; c < POSE; c++) sure += pow(p->change[c] / p->sigma[c], 2) / (POSE * n);
    }
    r->shift = sqrt(sum[0]), r->turn = sqrt(sum[1]), r->gain = sqrt(sum[2]);
    return sqrt(sure);
}

static int solve(refined *r, lightfield *f, const char *octree, errmsg *e)
{
    const poseplan plan = {PLACES * f->size, TURNS, GAINS};
    landmarks l = {0};
    views v = {0};
    int bad = views_make(&v, f, BRIGHT * typical(f), e) || find_landmarks(&l, octree, f, e);

    if (!bad) bad = poses_solve(&r->found, f, &v, &l, &plan, e);
    landmarks_free(&l), views_free(&v);
    return bad;
}

int refine(refined *r, lightfield *f, const char *octree, refining how, errmsg *e)
{
    memset(r, 0, sizeof *r);
    if (how == REFINE_NEVER || f->n < FEWEST || f->n > MOST) return 0;
    const size_t places = (size_t)f->n * sizeof *f->pos, turns = (size_t)f->n * sizeof *f->turn;
    double(*pos)[3] = malloc(places), (*turn)[9] = malloc(turns);
    int bad = pos && turn ? 0 : err_set(e, "no memory for poses");
    if (!bad) {
        memcpy(pos, f->pos, places), memcpy(turn, f->turn, turns);
        bad = solve(r, f, octree, e);
    }
    if (!bad) {
        const double sure = summarise(r, f->n);
        r->tried = 1;
        r->applied = how == REFINE_ALWAYS || (r->found.after < HELPS * r->found.before && sure > SURELY);
        if (r->applied) poses_expose(f, &r->found);
        else memcpy(f->pos, pos, places), memcpy(f->turn, turn, turns);
    }
    free(pos), free(turn);
    if (bad) refined_free(r);
    return bad;
}

void refined_free(refined *r)
{
    poses_free(&r->found);
}
