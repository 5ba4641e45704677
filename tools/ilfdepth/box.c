/*
 * box.c - a room as a box, fitted to swept distances.
 */
#include "box.h"

#include <stdlib.h>
#include <string.h>

#include "boxphoto.h"
#include "sweep.h"
#include "vec3.h"

static const double pi = 3.14159265358979323846;
enum { MOST_POINTS = 2500, TURNS = 9 };

double box_near(const box *b, const double o[3], const double d[3])
{
    double e[3], p[3], q[3], near = 0;

    v3_add(e, o, -1, b->c);
    v3_into(p, b->axis, e), v3_into(q, b->axis, d);
    for (int k = 0; k < 3; k++) {
        const double room = q[k] > 0 ? b->side[2 * k + 1] - p[k] : b->side[2 * k] + p[k];
        near = fmax(near, fabs(q[k]) / fmax(room, 1e-6 * b->side[2 * k + 1]));
    }
    return near;
}

typedef struct point {
    double o[3], d[3], near, weight, most; /* most: the greatest nearness that was looked for */
} point;

/* Up to MOST_POINTS cells of the maps, weighted by their solid angle and how sure they are. */
static int gather(point *pt, const depthmap *maps, int n, const views *s, const sweep_plan *p)
{
    long all = 0, seen = 0;
    int many = 0;

    for (int k = 0; k < n; k++) all += p->held[maps[k].view] ? 0 : maps[k].w * maps[k].h;
    for (int k = 0; k < n; k++)
        for (int i = 0; i < maps[k].w * maps[k].h && !p->held[maps[k].view]; i++, seen++) {
            const depthmap *m = &maps[k];
            if (many >= MOST_POINTS || seen * MOST_POINTS / all < many) continue;
            point *q = &pt[many];
            depthmap_direction(q->d, m, s, i % m->w, i / m->w);
            memcpy(q->o, s->v[m->view].at, sizeof q->o);
            q->near = fmin(p->most, (double)m->free[i]), q->most = p->most;
            q->weight = (double)m->sure[i] * sin(s->v[m->view].polar_max * (i / m->w + .5) / m->h);
            if (q->near > 0 && q->weight > 0) many++;
        }
    return many;
}

/* Of a point's nearness from the box's, as a logarithm; what lies nearer than was looked for says no more than that. */
static double departs(const box *b, const point *p)
{
    return fabs(log(p->near / fmin(p->most, box_near(b, p->o, p->d))));
}

static double misfit(const box *b, const point *pt, int n)
{
    double sum = 0, all = 1e-30;

    for (int k = 0; k < n; k++) {
        sum += pt[k].weight * fmin(.25, departs(b, &pt[k]));
        all += pt[k].weight;
    }
    return sum / all;
}

/* The side (0 to 5) that a direction in the box's axes looks at most. */
static int looks_at(const double q[3])
{
    int k = 0;

    for (int c = 1; c < 3; c++)
        if (fabs(q[c]) > fabs(q[k])) k = c;
    return 2 * k + (q[k] > 0);
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Distances to a side of the points that lie towards it: found ones, or (clipped) those that may be nearer still. */
static int towards(double *at, const box *b, const point *pt, int n, int side, int clipped)
{
    int many = 0;

    for (int k = 0; k < n; k++) {
        double p[3], q[3];
        if (clipped != (pt[k].near > .97 * pt[k].most)) continue;
        v3_add(p, pt[k].o, 1 / pt[k].near, pt[k].d);
        v3_add(p, p, -1, b->c);
        v3_into(q, b->axis, p);
        if (looks_at(q) == side) at[many++] = fabs(q[side / 2]);
    }
    return many;
}

/* Each side at the median of the points that lie towards it: of those found, unless nearly all may be nearer. */
static void begin_at_medians(box *b, const point *pt, int n, double reach)
{
    double *at = malloc((size_t)n * sizeof *at);

    for (int side = 0; side < 6 && at; side++) {
        int many = towards(at, b, pt, n, side, 0);
        const int clipped = towards(at + many, b, pt, n, side, 1);
        double *from = at;
        if (many < .2 * clipped) from += many, many = clipped;
        b->seen[side] = many > .003 * n;
        if (many) qsort(from, (size_t)many, sizeof *from, compare);
        b->side[side] = b->seen[side] ? from[many / 2] : reach;
    }
    free(at);
}

static double improve(box *b, const point *pt, int n)
{
    double best = misfit(b, pt, n), span = .3;

    for (int round = 0; round < 16; round++, span *= .8)
        for (int k = 0; k < 36; k++) {
            box t = *b;
            if (!t.seen[k / 6]) continue;
            t.side[k / 6] *= k & 1 ? 1 + span : 1 / (1 + span);
            const double m = misfit(&t, pt, n);
            if (m < best) best = m, *b = t;
        }
    return best;
}

static void turn_about_pole(box *b, double angle)
{
    memset(b->axis, 0, sizeof b->axis);
    b->axis[0][0] = b->axis[1][1] = cos(angle);
    b->axis[0][1] = sin(angle), b->axis[1][0] = -sin(angle), b->axis[2][2] = 1;
}

static void explained(box *b, const point *pt, int n)
{
    double sum = 0, all = 1e-30;

    for (int k = 0; k < n; k++) {
        sum += pt[k].weight * (departs(b, &pt[k]) < .05);
        all += pt[k].weight;
    }
    b->explains = sum / all;
}

int box_fit(box *b, const depthmap *maps, int n, const views *s, const sweep_plan *p, errmsg *e)
{
    point *pt = malloc(MOST_POINTS * sizeof *pt);
    double best = 1e30;

    memset(b, 0, sizeof *b);
    if (!pt) return err_set(e, "no memory for a box");
    const int many = gather(pt, maps, n, s, p);
    for (int k = 0; k < TURNS && many > 100; k++) {
        box t = {0};
        memcpy(t.c, s->centre, sizeof t.c);
        turn_about_pole(&t, k * pi / 2 / TURNS);
        begin_at_medians(&t, pt, many, s->reach);
        const double m = improve(&t, pt, many);
        if (m < best) best = m, *b = t;
    }
    b->fitted = best < .14; /* else hardly anything lies on it */
    const int bad = b->fitted ? boxphoto_fit(b, maps, n, s, p, e) : 0;
    if (!bad) explained(b, pt, many);
    free(pt);
    return bad;
}

/* Mean over the cells up to two steps away. */
static void blur(float *to, const float *from, int W, int H)
{
    for (int k = 0; k < W * H; k++) {
        const int x = k % W, y = k / W;
        float sum = 0;
        int n = 0;
        for (int v = y - 2; v <= y + 2; v++)
            for (int u = x - 2; u <= x + 2; u++)
                if (v >= 0 && v < H) sum += from[v * W + (u + W) % W], n++;
        to[k] = sum / (float)n;
    }
}

/* room: 4*cells floats: costs by the box, costs as swept, both blurred, then the share of box. */
static void compete(sweep *w, const box *b, float *room)
{
    const int n = w->m->w * w->m->h;
    float *by_box = room, *swept = room + n, *soft = room + 2 * n, *near = room + 3 * n;

    for (int k = 0; k < n; k++) {
        const double d[3] = {(double)w->dir[k][0], (double)w->dir[k][1], (double)w->dir[k][2]};
        near[k] = (float)box_near(b, w->s->v[w->m->view].at, d);
        const int ok = w->feature[k][0] > -1e3f;
        by_box[k] = ok ? sweep_cost(w, w->dir[k], w->feature[k], near[k]) : 0;
        swept[k] = ok ? sweep_cost(w, w->dir[k], w->feature[k], w->m->free[k]) : 0;
    }
    blur(soft, by_box, w->m->w, w->m->h), blur(by_box, swept, w->m->w, w->m->h);
    for (int k = 0; k < n; k++)
        swept[k] = soft[k] <= 1.15f * by_box[k] + .5f * w->noise || fabsf(near[k] / w->m->free[k] - 1) < .03f;
    blur(soft, swept, w->m->w, w->m->h);
    for (int k = 0; k < n; k++)
        if (soft[k] > .5f) w->m->near[k] = near[k], w->m->from[k] = DEPTH_BOX;
}

int box_compete(depthmap *maps, int n, const box *b, const views *s, const sweep_plan *p, errmsg *e)
{
    int bad = 0;

#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < n; k++) {
        errmsg mine;
        sweep w = {.s = s, .p = p, .m = &maps[k], .noise = (float)maps[k].fit};
        float *room = malloc(4 * (size_t)maps[k].w * (size_t)maps[k].h * sizeof *room);
        const int failed = !room ? err_set(&mine, "no memory for a box") : sweep_begin(&w, &mine);
        if (!failed) compete(&w, b, room);
        sweep_end(&w), free(room);
#pragma omp critical
        if (failed && !bad) {
            bad = -1;
            if (e) *e = mine;
        }
    }
    return bad;
}
