/*
 * poses.c - see poses.h.
 *
 * Each measurement is linear in small changes of the pose: a landmark at x is looked for in the direction
 * e = (x - p)/|x - p| of picture k; a turn w about the field's axes, a shift s of the picture and one m of
 * the landmark move it by
 *     de = -w x e + (m - s)/|x - p|          (across e)
 * within the picture.  Gauss-Newton, from coarse pictures to fine ones; what contradicts the rest weighs less
 * each round (Geman and McClure's weights, scales from
 * medians).
 */
#include "poses.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "beacons.h"
#include "ilflamps/vec.h"

enum { STEPS = 15, OUTER = 4, ROUNDS = 15, LAST_ROUNDS = 40 };
#define SETTLED     2e-6 /* radians, or sizes of the plane: the last step */
#define DOUBTFUL    2.5  /* scales: from there on a measurement weighs less than half */
#define FINEST_LOG  2e-4 /* least scale of log luminance */
#define FINEST_TX   .02  /* least scale of an angle, texels */
#define REACH       3    /* texels on both sides of a crease that are looked at */
#define COMMON      .008 /* texels: see part_of_creases */
#define INDEPENDENT 8
#define CONTRAST    .05 /* of a step that is one */
#define STEEP       4   /* times the others' gradient: another thing's edge */
#define FLAT        .2  /* log luminance a radian that is always believed */
#define UNEQUAL     .3  /* log luminance: more is another thing */
#define LOOSE       .3  /* the box may move by so many of its heights, lamps by so many distances */

/* ---- the normal equations -------------------------------------------------------------------------- */

typedef struct solver {
    lightfield *f;
    const views *v;
    landmarks *l;
    beacons b;
    poses *out;
    const poseplan *plan;
    int n, level;         /* unknowns */
    double *N, *y, *mean; /* n*n, n, n */
    double *ways;         /* TOGETHER*n */
    double scale[2];      /* of creases, lamps */
    double *own;          /* of each picture's points */
} solver;

enum { CREASE, LAMP };

/* One measurement: r + J d should be 0. */
typedef struct equation {
    int n, at[POSE + BOX + 3];
    double J[POSE + BOX + 3], r;
    double steep; /* of points: size of the gradient */
} equation;

static void term(equation *q, int at, double J)
{
    q->at[q->n] = at, q->J[q->n++] = J;
}

static int box_at(const solver *s)
{
    return POSE * s->f->n;
}

static int lamp_at(const solver *s, int lamp)
{
    return box_at(s) + s->l->movable + 3 * lamp;
}

/* Derivative of the component of de along g (across e) with the unknowns, times `sign`. */
static void lean_on(equation *q, const solver *s, int k, const double e[3], double dist, const double g[3],
                    double sign, const landmark *m)
{
    double turn[3];

    v_cross(turn, e, g);
    for (int c = 0; c < 3; c++) {
        term(q, POSE * k + c, -sign * g[c] / dist);
        term(q, POSE * k + 3 + c, -sign * turn[c]);
    }
    for (int c = 0; m && c < s->l->movable; c++) term(q, box_at(s) + c, sign * v_dot(g, m->lean[c]) / dist);
}

static void add(solver *s, const equation *q, double w)
{
    for (int i = 0; i < q->n; i++) {
        s->y[q->at[i]] -= w * q->J[i] * q->r;
        for (int j = 0; j < q->n; j++)
            s->N[(size_t)q->at[i] * (size_t)s->n + (size_t)q->at[j]] += w * q->J[i] * q->J[j];
    }
}

static double weight(double c, double r)
{
    const double q = 1 + r * r / (DOUBTFUL * DOUBTFUL * c * c);

    return 1 / (c * c * q * q);
}

/* ---- points ----------------------------------------------------------------------------------------- */

/* Direction from picture k to a landmark, its distance. */
static double towards(double e[3], const lightfield *f, int k, const double x[3])
{
    v_sub(e, x, f->pos[k]);
    return v_unit(e);
}

/* Log luminance of a point less the picture's gain, and its gradient across the direction; 0 if it isn't known. */
static int point_of(equation *q, const solver *s, int k, const landmark *m)
{
    double e[3], x[3], y[3], g[3], side[4];
    const double dist = towards(e, s->f, k, m->x), eps = .5 * s->v->v[s->level].dp;

    q->n = 0;
    q->r = log(views_look(s->v, s->level, k, e));
    if (!isfinite(q->r)) return 0;
    v_basis(x, y, e);
    for (int i = 0; i < 4; i++) {
        const double *t = i < 2 ? x : y, h = i & 1 ? -eps : eps;
        double d[3];
        for (int c = 0; c < 3; c++) d[c] = e[c] + h * t[c];
        side[i] = log(views_look(s->v, s->level, k, d));
        if (!isfinite(side[i])) return 0;
    }
    for (int c = 0; c < 3; c++) g[c] = ((side[0] - side[1]) * x[c] + (side[2] - side[3]) * y[c]) / (2 * eps);
    q->steep = v_len(g);
    lean_on(q, s, k, e, dist, g, 1, m);
    q->r -= s->out->p[k].change[6];
    term(q, POSE * k + 6, -1);
    return 1;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double median(double *v, int n)
{
    qsort(v, (size_t)n, sizeof *v, by_value);
    return n & 1 ? v[n / 2] : .5 * (v[n / 2 - 1] + v[n / 2]);
}

/* The pictures' equations of one point; returns how many there are, residuals about their median. */
static int equations_of(equation *q, double *tmp, const solver *s, const landmark *m)
{
    int n = 0;

    for (int k = 0; k < s->f->n; k++)
        if (point_of(&q[n], s, k, m)) tmp[n] = q[n].r, n++;
    if (n < 3) return 0;
    const double mid = median(tmp, n);
    for (int i = 0; i < n; i++) q[i].r -= mid, tmp[i] = q[i].steep;
    const double steep = STEEP * median(tmp, n) + FLAT;
    int kept = 0;
    for (int i = 0; i < n; i++)
        if (q[i].steep < steep && fabs(q[i].r) < UNEQUAL) q[kept++] = q[i];
    return kept;
}

/* A point's own luminance is unknown, too: what is left once it is eliminated. */
static void add_point(solver *s, const equation *q, int n)
{
    double all = 0, sum = 0;

    memset(s->mean, 0, (size_t)s->n * sizeof *s->mean);
    for (int i = 0; i < n; i++) {
        const double w = weight(s->own[q[i].at[0] / POSE], q[i].r);
        add(s, &q[i], w);
        all += w, sum += w * q[i].r;
        for (int c = 0; c < q[i].n; c++) s->mean[q[i].at[c]] += w * q[i].J[c];
    }
    if (!(all > 0)) return;
    for (int a = 0; a < s->n; a++) {
        if (!(fabs(s->mean[a]) > 0)) continue;
        s->y[a] += s->mean[a] * sum / all;
        for (int b = 0; b < s->n; b++)
            s->N[(size_t)a * (size_t)s->n + (size_t)b] -= s->mean[a] * s->mean[b] / all;
    }
}

/* ---- creases ---------------------------------------------------------------------------------------- */

/* A straight line through OUTER samples from `first` on: value at 0 and slope, t in samples. */
static void line_of(double line[2], const double *v, int first)
{
    double mean = 0, middle = 0, tv = 0, tt = 0;

    for (int q = first; q < first + OUTER; q++)
        mean += v[q] / OUTER, middle += (q - .5 * (STEPS - 1)) / OUTER;
    for (int q = first; q < first + OUTER; q++) {
        const double t = q - .5 * (STEPS - 1) - middle;
        tv += t * v[q], tt += t * t;
    }
    line[1] = tv / tt, line[0] = mean - line[1] * middle;
}

/* Where one line must end and the other begin for the same area below; in samples from the middle. */
static double change_over(const double *v, const double a[2], const double b[2])
{
    const double r = .5 * (STEPS - 1);
    double area = 0, t = 0;

    for (int q = 0; q < STEPS; q++) area += v[q] * (q == 0 || q == STEPS - 1 ? .5 : 1);
    for (int round = 0; round < 4; round++) {
        const double have = a[0] * (t + r) + a[1] * (t * t - r * r) / 2 + b[0] * (r - t) +
                            b[1] * (r * r - t * t) / 2,
                     gain = a[0] + a[1] * t - b[0] - b[1] * t;
        t = fmax(-r, fmin(r, t + (area - have) / gain));
    }
    return t;
}

/* How far beyond its place (radians, along n) a picture's luminance steps; 0 if it doesn't. */
static int step_at(double *off, const solver *s, int k, const double e[3], const double n[3])
{
    const double sample = REACH * s->v->v[s->level].dp * 2 / (STEPS - 1);
    double v[STEPS], travel = 0, a[2], b[2];

    for (int q = 0; q < STEPS; q++) {
        double d[3];
        for (int c = 0; c < 3; c++) d[c] = e[c] + sample * (q - .5 * (STEPS - 1)) * n[c];
        v[q] = views_look(s->v, s->level, k, d);
        if (!isfinite(v[q])) return 0;
        if (q) travel += fabs(v[q] - v[q - 1]);
    }
    line_of(a, v, 0), line_of(b, v, STEPS - OUTER);
    const double step = fabs(a[0] - b[0]);
    if (step < CONTRAST * (a[0] + b[0]) || fmax(fabs(a[1]), fabs(b[1])) * STEPS > step || travel > 1.5 * step)
        return 0;
    *off = sample * change_over(v, a, b);
    return fabs(*off) < .5 * REACH * s->v->v[s->level].dp;
}

static int crease_of(equation *q, const solver *s, int k, const landmark *m)
{
    double e[3], n[3], off;
    const double dist = towards(e, s->f, k, m->x);

    v_cross(n, e, m->along);
    if (v_unit(n) < .3 || !step_at(&off, s, k, e, n)) return 0;
    q->n = 0, q->r = off;
    lean_on(q, s, k, e, dist, n, -1, m);
    return 1;
}

/* ---- lamps ------------------------------------------------------------------------------------------ */

/* Two equations of a sighting. */
static void sighting_of(equation q[2], const solver *s, const sighting *b)
{
    double e[3], seen[3] = {b->dir[0], b->dir[1], b->dir[2]}, t[2][3], off[3];
    const double dist = towards(e, s->f, b->picture, s->b.at[b->lamp]);

    lf_outward(seen, s->f, b->picture);
    v_sub(off, seen, e);
    v_basis(t[0], t[1], e);
    for (int i = 0; i < 2; i++) {
        q[i].n = 0, q[i].r = v_dot(off, t[i]);
        lean_on(&q[i], s, b->picture, e, dist, t[i], -1, NULL);
        for (int c = 0; c < 3; c++) term(&q[i], lamp_at(s, b->lamp) + c, -t[i][c] / dist);
    }
}

/* ---- all of them ------------------------------------------------------------------------------------ */

/* All equations in one list; points' groups are told by their counts. */
typedef struct list {
    equation *q;
    int *group; /* of each point landmark: how many */
    int n, points, creases, lamps;
} list;

static int gather(list *l, const solver *s)
{
    const int pictures = s->f->n, points = s->l->n - s->l->creases;
    const size_t room = (size_t)s->l->n * (size_t)pictures + 2 * (size_t)s->b.n + 1;
    double *tmp = malloc((size_t)pictures * sizeof *tmp);

    memset(l, 0, sizeof *l);
    l->q = malloc(room * sizeof *l->q), l->group = malloc((size_t)(points + 1) * sizeof *l->group);
    if (!l->q || !l->group || !tmp) {
        free(tmp);
        return -1;
    }
    for (int i = 0; i < points; i++) l->n += l->group[i] = equations_of(l->q + l->n, tmp, s, &s->l->m[i]);
    l->points = l->n;
    for (int i = points; i < s->l->n; i++)
        for (int k = 0; k < pictures; k++) l->n += crease_of(l->q + l->n, s, k, &s->l->m[i]);
    l->creases = l->n - l->points;
    for (int i = 0; i < s->b.n; i++, l->n += 2) sighting_of(l->q + l->n, s, &s->b.s[i]);
    l->lamps = l->n - l->points - l->creases;
    free(tmp);
    return 0;
}

static void list_free(list *l)
{
    free(l->q), free(l->group);
}

/* Median size of residuals, as a normal distribution's standard error; of one picture's, or all (-1). */
static double scale_of(const equation *q, int n, int picture, double least)
{
    double *v = malloc((size_t)(n + 1) * sizeof *v), m = least;
    int have = 0;

    for (int i = 0; v && i < n; i++)
        if (picture < 0 || q[i].at[0] / POSE == picture) v[have++] = fabs(q[i].r);
    if (v && have > 0) m = fmax(least, 1.4826 * median(v, have));
    free(v);
    return m;
}

/* Points' for each picture: all of a picture that stands wrong disagrees, and must still be heard. */
static void set_scales(solver *s, const list *l)
{
    const double tx = s->v->v[s->level].dp;

    for (int k = 0; k < s->f->n; k++) s->own[k] = scale_of(l->q, l->points, k, FINEST_LOG);
    s->scale[CREASE] = scale_of(l->q + l->points, l->creases, -1, FINEST_TX * tx);
    s->scale[LAMP] = scale_of(l->q + l->points + l->creases, l->lamps, -1, FINEST_TX * s->f->dp);
}

static void add_prior(solver *s, int at, double value, double sigma)
{
    s->N[(size_t)at * (size_t)s->n + (size_t)at] += 1 / (sigma * sigma);
    s->y[at] -= value / (sigma * sigma);
}

static void add_priors(solver *s)
{
    const double sigma[3] = {s->plan->place, s->plan->turn, s->plan->gain};

    for (int k = 0; k < s->f->n; k++)
        for (int c = 0; c < POSE; c++)
            add_prior(s, POSE * k + c, s->out->p[k].change[c],
                      c == 5 && s->plan->heading ? s->plan->heading[k] : sigma[c / 3]);
    for (int c = 0; c < s->l->movable; c++)
        add_prior(s, box_at(s) + c, 0, c < 5 ? LOOSE * s->l->box[4] : .05);
    for (int i = 0; i < s->b.lamps; i++)
        for (int c = 0; c < 3; c++) add_prior(s, lamp_at(s, i) + c, 0, LOOSE * v_len(s->b.at[i]));
}

/* ---- what points can't say -------------------------------------------------------------------------- */

/* All pictures may be moved and turned together without any disagreement of walls' points to speak of: what is
 * seen is another part of the same wall.  (Where the box moves along, exactly; then they may be scaled,
 * too.)  Small faults of the derivatives would say something nevertheless, of which there are so many
 * that creases and given poses would not be heard; so the points' equations are made blind for it. */
enum { TOGETHER = 7 };

/* Unit of an unknown. */
static double unit_of(const solver *s, int at)
{
    const double unit[3] = {s->plan->place, s->plan->turn, s->plan->gain};

    if (at < box_at(s)) return unit[at % POSE / 3];
    return at == box_at(s) + 5 && s->l->movable ? s->plan->turn : s->plan->place;
}

static void turn_all(double *g, const solver *s, int axis)
{
    const double w[3] = {axis == 0, axis == 1, axis == 2};

    for (int k = 0; k < s->f->n; k++) {
        double off[3];
        v_sub(off, s->f->pos[k], s->l->middle);
        v_cross(g + POSE * k, w, off);
        g[POSE * k + 3 + axis] = 1;
    }
    if (s->l->movable && axis == 2) g[box_at(s) + 5] = 1;
}

static void move_all(double *g, const solver *s, int axis)
{
    for (int k = 0; k < s->f->n; k++) g[POSE * k + axis] = 1;
    for (int c = 0; c < s->l->movable; c++) g[box_at(s) + c] = axis == (c < 5 ? c / 2 : -1);
}

static void scale_all(double *g, const solver *s)
{
    const double *box = s->l->box;

    for (int k = 0; k < s->f->n; k++) v_sub(g + POSE * k, s->f->pos[k], s->l->middle);
    for (int c = 0; c < 5; c++) g[box_at(s) + c] = box[c] - s->l->middle[c / 2];
}

/* Way number k that all may go together, in units of the unknowns, at right angles to those before; 0: none. */
static int together(double *g, const solver *s, int k, const double *before)
{
    double len = 0;

    memset(g, 0, (size_t)s->n * sizeof *g);
    if (k < 3) move_all(g, s, k);
    else if (k < 6) turn_all(g, s, k - 3);
    else if (s->l->movable) scale_all(g, s);
    else return 0;
    for (int i = 0; i < s->n; i++) g[i] /= unit_of(s, i);
    for (int b = 0; b < k; b++) {
        double dot = 0;
        for (int i = 0; i < s->n; i++) dot += g[i] * before[b * s->n + i];
        for (int i = 0; i < s->n; i++) g[i] -= dot * before[b * s->n + i];
    }
    for (int i = 0; i < s->n; i++) len += g[i] * g[i];
    for (int i = 0; i < s->n; i++) g[i] /= sqrt(len);
    return len > 0;
}

/* N and y (in units of the unknowns) without what lies along g. */
static void make_blind(solver *s, const double *g)
{
    const int n = s->n;
    double gy = 0, gNg = 0, *Ng = s->mean;

    for (int i = 0; i < n; i++) {
        Ng[i] = 0, gy += g[i] * s->y[i];
        for (int j = 0; j < n; j++) Ng[i] += s->N[(size_t)i * (size_t)n + (size_t)j] * g[j];
    }
    for (int i = 0; i < n; i++) gNg += g[i] * Ng[i];
    for (int i = 0; i < n; i++) {
        s->y[i] -= gy * g[i];
        for (int j = 0; j < n; j++)
            s->N[(size_t)i * (size_t)n + (size_t)j] -= g[i] * Ng[j] + Ng[i] * g[j] - gNg * g[i] * g[j];
    }
}

static void rescale(solver *s, int back)
{
    for (int i = 0; i < s->n; i++) {
        const double u = back ? 1 / unit_of(s, i) : unit_of(s, i);
        s->y[i] *= u;
        for (int j = 0; j < s->n; j++)
            s->N[(size_t)i * (size_t)s->n + (size_t)j] *= u * (back ? 1 / unit_of(s, j) : unit_of(s, j));
    }
}

static void blind_for_all(solver *s)
{
    rescale(s, 0);
    for (int k = 0; k < TOGETHER && together(s->ways + k * s->n, s, k, s->ways); k++)
        make_blind(s, s->ways + k * s->n);
    rescale(s, 1);
}

/* All sightings of creases are wrong by the same part of a texel (how luminance runs beside them), so that many
 * say no more than a few: they count as INDEPENDENT ones of error COMMON. */
static double part_of_creases(const solver *s, const list *l)
{
    const double c = s->scale[CREASE] / (COMMON * s->v->v[s->level].dp);

    return fmin(1, INDEPENDENT * c * c / (l->creases + 1));
}

static void assemble(solver *s, const list *l)
{
    const equation *q = l->q;

    memset(s->N, 0, (size_t)s->n * (size_t)s->n * sizeof *s->N);
    memset(s->y, 0, (size_t)s->n * sizeof *s->y);
    for (int i = 0; i < s->l->n - s->l->creases; q += l->group[i], i++) add_point(s, q, l->group[i]);
    blind_for_all(s);
    const double part = part_of_creases(s, l);
    for (int i = 0; i < l->creases; i++, q++) add(s, q, part * weight(s->scale[CREASE], q->r));
    for (int i = 0; i < l->lamps; i++, q++) add(s, q, weight(s->scale[LAMP], q->r));
    add_priors(s);
}

static void turn_by(double axes[9], const double w[3])
{
    double axis[3] = {w[0], w[1], w[2]};
    const double angle = v_unit(axis);

    for (int r = 0; r < 3 && angle > 0; r++) v_rotate(axes + 3 * r, axis, angle);
}

/* Take a step; returns its largest change of a direction, radians. */
static double take(solver *s, const double *d)
{
    double most = 0;

    for (int k = 0; k < s->f->n; k++) {
        for (int c = 0; c < POSE; c++) s->out->p[k].change[c] += d[POSE * k + c];
        for (int c = 0; c < 3; c++) {
            s->f->pos[k][c] += d[POSE * k + c];
            most = fmax(most, fmax(fabs(d[POSE * k + 3 + c]), fabs(d[POSE * k + c]) / s->f->size));
        }
        turn_by(s->f->turn[k], d + POSE * k + 3);
    }
    if (s->l->movable) landmarks_move(s->l, d + box_at(s));
    for (int i = 0; i < s->b.lamps; i++)
        for (int c = 0; c < 3; c++) s->b.at[i][c] += d[lamp_at(s, i) + c];
    return most;
}

/* One round; 1 when nothing moves any more, -1 without memory. */
static int one_round(solver *s, errmsg *e)
{
    list l;

    if (gather(&l, s)) {
        list_free(&l);
        return err_set(e, "no memory for poses");
    }
    set_scales(s, &l);
    assemble(s, &l);
    s->out->points = l.points, s->out->edges = l.creases;
    list_free(&l);
    if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', s->n, s->N, s->n) ||
        LAPACKE_dpotrs(LAPACK_ROW_MAJOR, 'L', s->n, 1, s->N, s->n, s->y, 1))
        return err_set(e, "poses: no solution");
    return take(s, s->y) < SETTLED;
}

static void set_sigmas(solver *s)
{
    if (LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'L', s->n, s->N, s->n)) return;
    for (int k = 0; k < s->f->n; k++)
        for (int c = 0; c < POSE; c++)
            s->out->p[k].sigma[c] = sqrt(s->N[(size_t)(POSE * k + c) * (size_t)(s->n + 1)]);
}

/* Scale of the points' disagreement as poses stand. */
static int disagreement(double *value, solver *s, errmsg *e)
{
    list l;

    s->level = 0;
    const int bad = gather(&l, s);
    if (!bad) *value = scale_of(l.q, l.points, -1, 0);
    list_free(&l);
    return bad ? err_set(e, "no memory for poses") : 0;
}

static int solver_make(solver *s, errmsg *e)
{
    s->out->p = calloc((size_t)s->f->n, sizeof *s->out->p);
    if (beacons_find(&s->b, s->f, e)) return -1;
    s->out->lamps = s->b.lamps, s->out->sightings = s->b.n;
    s->n = POSE * s->f->n + s->l->movable + 3 * s->b.lamps;
    s->N = malloc((size_t)s->n * (size_t)s->n * sizeof *s->N);
    s->y = malloc((size_t)s->n * sizeof *s->y), s->mean = malloc((size_t)s->n * sizeof *s->mean);
    s->ways = malloc(TOGETHER * (size_t)s->n * sizeof *s->ways);
    s->own = malloc((size_t)s->f->n * sizeof *s->own);
    return s->out->p && s->N && s->y && s->mean && s->ways && s->own ? 0 : err_set(e, "no memory for poses");
}

int poses_solve(poses *out, lightfield *f, const views *v, landmarks *l, const poseplan *plan, errmsg *e)
{
    solver s = {.f = f, .v = v, .l = l, .out = out, .plan = plan};
    int bad;

    memset(out, 0, sizeof *out);
    bad = solver_make(&s, e) || disagreement(&out->before, &s, e);
    for (int level = v->n - 1; level >= 0 && !bad; level--) {
        int done = 0;
        s.level = level;
        for (int round = 0; round < (level ? ROUNDS : LAST_ROUNDS) && !done && !bad; round++) {
            done = one_round(&s, e);
            bad = done < 0;
        }
    }
    for (int k = 0; k < f->n && !bad; k++) out->p[k].differs = s.own[k];
    if (!bad) {
        set_sigmas(&s);
        bad = disagreement(&out->after, &s, e);
    }
    free(s.N), free(s.y), free(s.mean), free(s.ways), free(s.own);
    beacons_free(&s.b);
    return bad ? -1 : 0;
}

void poses_free(poses *p)
{
    free(p->p);
    memset(p, 0, sizeof *p);
}

void poses_expose(lightfield *f, const poses *p)
{
    const size_t all = (size_t)f->np * (size_t)f->nt * 3;

    for (int k = 0; k < f->n; k++) {
        const float g = (float)exp(-p->p[k].change[6]);
        for (size_t i = 0; i < all; i++) f->rgb[(size_t)k * all + i] *= g;
    }
}
