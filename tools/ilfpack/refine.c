/*
 * refine.c - see refine.h.
 */
#include "refine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/blobs.h"
#include "shots.h"

enum { FEWEST = 4 };
#define BRIGHT  15.  /* times the typical luminance: no wall */
#define PLACES  .006 /* what is given is about so sure: sizes of the plane, */
#define TURNS   .01  /* radians, */
#define FOUND   .05  /* headings that a lamp told, radians */
#define GAINS   .05  /* relative */
#define HELPS   .85  /* part of the pictures' disagreement that must be left at most */
#define UNHEARD .85  /* part of the disagreement that is left without creases where they are wrong */
#define HALVES  .5   /* the same where no more is asked */
#define SURELY  4.   /* standard errors that a correction must have, rms */

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

/* What poses are compared by. */
typedef struct evidence {
    landmarks l;
    views v;
} evidence;

static int evidence_make(evidence *x, const lightfield *f, const char *octree, errmsg *e)
{
    memset(x, 0, sizeof *x);
    return views_make(&x->v, f, BRIGHT * blobs_typical(f), e) || find_landmarks(&x->l, octree, f, e) ? -1 : 0;
}

static void evidence_free(evidence *x)
{
    landmarks_free(&x->l), views_free(&x->v);
}

/* Put right what can't be true; the box is estimated anew then. */
static int put_right(refined *r, evidence *x, lightfield *f, place *at, char *const *pictures,
                     const char *octree, refining how, errmsg *e)
{
    if (suspects_find(&r->wrong, f, at, pictures, &x->v, &x->l, how == REFINE_NEVER, e)) return -1;
    if (!r->wrong.n || octree || how == REFINE_NEVER) return 0;
    landmarks_free(&x->l);
    return find_landmarks(&x->l, octree, f, e);
}

/* Creases alone say how all pictures stand together; on walls with patterns beside them they may be wrong by much of
 * a texel.  Then the walls' points disagree more with them than without them, and they are not heard.  pos, turn:
 * places as given; the field has them again, or the solution. */
static int without_creases(poses *found, evidence *x, lightfield *f, const poseplan *plan,
                           const double (*pos)[3], const double (*turn)[9], errmsg *e)
{
    const size_t where = (size_t)f->n * sizeof *f->pos, turns = (size_t)f->n * sizeof *f->turn;
    const double after = found->after;
    const int creases = x->l.creases;
    double(*own_pos)[3] = malloc(where), (*own_turn)[9] = malloc(turns);
    poses plain = {0};
    int bad = own_pos && own_turn ? 0 : err_set(e, "no memory for poses");

    if (!bad) {
        memcpy(own_pos, f->pos, where), memcpy(own_turn, f->turn, turns);
        memcpy(f->pos, pos, where), memcpy(f->turn, turn, turns);
        x->l.n -= creases, x->l.creases = 0;
        bad = poses_solve(&plain, f, &x->v, &x->l, plan, e);
        x->l.n += creases, x->l.creases = creases;
    }
    if (!bad && plain.after < UNHEARD * after) {
        poses_free(found);
        *found = plain, memset(&plain, 0, sizeof plain);
    } else if (!bad) memcpy(f->pos, own_pos, where), memcpy(f->turn, own_turn, turns);
    poses_free(&plain);
    free(own_pos), free(own_turn);
    return bad;
}

static int solve(refined *r, evidence *x, lightfield *f, const double *heading, refining how, errmsg *e)
{
    const poseplan plan = {PLACES * f->size, TURNS, GAINS, heading};
    const size_t where = (size_t)f->n * sizeof *f->pos, turns = (size_t)f->n * sizeof *f->turn;
    double(*pos)[3] = malloc(where), (*turn)[9] = malloc(turns);
    int bad = pos && turn ? 0 : err_set(e, "no memory for poses");

    if (!bad) {
        memcpy(pos, f->pos, where), memcpy(turn, f->turn, turns);
        bad = poses_solve(&r->found, f, &x->v, &x->l, &plan, e);
        if (!bad && x->l.creases && !x->l.movable) /* (a box that moves needs its edges) */
            bad =
                without_creases(&r->found, x, f, &plan, (const double(*)[3])pos, (const double(*)[9])turn, e);
    }
    if (!bad) {
        const double sure = summarise(r, f->n);
        r->tried = 1;
        r->applied = how == REFINE_ALWAYS || (r->found.after < HELPS * r->found.before &&
                                              (sure > SURELY || r->found.after < HALVES * r->found.before));
        if (r->applied) poses_expose(f, &r->found);
        else memcpy(f->pos, pos, where), memcpy(f->turn, turn, turns);
    }
    free(pos), free(turn);
    return bad;
}

/* Headings that a lamp told are less sure than those that were written down. */
static int solve_from(refined *r, evidence *x, lightfield *f, const place *at, refining how, errmsg *e)
{
    double *heading = malloc((size_t)f->n * sizeof *heading);

    if (!heading) return err_set(e, "no memory for poses");
    for (int k = 0; k < f->n; k++) heading[k] = at[k].unknown ? FOUND : TURNS;
    const int bad = solve(r, x, f, heading, how, e);
    free(heading);
    return bad;
}

int refine(refined *r, lightfield *f, place *at, char *const *pictures, const char *octree, refining how,
           errmsg *e)
{
    evidence x;
    int bad;

    memset(r, 0, sizeof *r);
    if (f->n < FEWEST) return 0;
    bad = evidence_make(&x, f, octree, e) || put_right(r, &x, f, at, pictures, octree, how, e);
    if (!bad && how != REFINE_NEVER && f->n <= REFINE_MOST) bad = solve_from(r, &x, f, at, how, e);
    for (int k = 0; k < f->n && !bad && r->applied; k++) shots_place(&at[k], f, k);
    evidence_free(&x);
    if (bad) refined_free(r);
    return bad ? -1 : 0;
}

void refined_free(refined *r)
{
    poses_free(&r->found), suspects_free(&r->wrong);
}
