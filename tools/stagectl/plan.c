/* plan.c - see plan.h. */
#include "plan.h"

#include <math.h>
#include <string.h>

long plan_places(const session *s)
{
    return s->listed ? s->n_listed : (long)s->nodes[0] * s->nodes[1];
}

static void to_machine(double machine[2], const session *s, const double plane[2])
{
    for (int a = 0; a < 2; a++) {
        int m = s->axis[a];
        machine[m] = s->origin[m] + s->sign[a] * plane[a] * s->unit_mm;
    }
}

void plan_on_plane(double plane[2], const session *s, const double machine[2])
{
    for (int a = 0; a < 2; a++) {
        int m = s->axis[a];
        plane[a] = s->sign[a] * (machine[m] - s->origin[m]) / s->unit_mm;
    }
}

void plan_place(place *p, const session *s, long index)
{
    int n = s->nodes[0];
    p->index = index;
    p->j = s->listed ? s->listed[index][1] : (int)(index / n);
    p->i = s->listed ? s->listed[index][0] : (int)(index % n);
    if (!s->listed && s->order == ORDER_SERPENTINE && p->j % 2 == 1) p->i = n - 1 - p->i;
    const int at[2] = {p->i, p->j};
    for (int a = 0; a < 2; a++) {
        const double *edge = s->plane + 3 + 3 * a;
        double length = hypot(hypot(edge[0], edge[1]), edge[2]);
        p->plane[a] = s->nodes[a] > 1 ? length * at[a] / (s->nodes[a] - 1) : length / 2;
    }
    to_machine(p->machine, s, p->plane);
}

int plan_path(double path[2][2], const session *s, const double *from, const double target[2])
{
    int detour = 0;
    for (int a = 0; a < 2; a++) {
        double b = s->backlash[a], d = from ? target[a] - from[a] : 0;
        /* An axis that does not move keeps its side; one whose side is unknown or that would come from the
         * other side goes past the target first. */
        int wrong = b != 0 && (!from || d * b < 0);
        path[0][a] = wrong ? target[a] - b : target[a];
        path[1][a] = target[a];
        detour |= wrong;
    }
    return detour ? 2 : 1;
}

double plan_move_seconds(double mm, double feed, double acceleration)
{
    double v = feed / 60;
    if (!(mm > 0)) return 0;
    if (!(acceleration > 0)) return mm / v;
    return mm >= v * v / acceleration ? mm / v + v / acceleration : 2 * sqrt(mm / acceleration);
}

/* Walk the whole plan; tell each leg. */
typedef int leg_fn(void *arg, const place *p, const double *from, const double to[2], int last, errmsg *e);

static int walk(const session *s, leg_fn *leg, void *arg, errmsg *e)
{
    double path[2][2], at[2];
    const double *from = NULL;
    for (long k = 0; k < plan_places(s); k++) {
        place p;
        plan_place(&p, s, k);
        int n = plan_path(path, s, from, p.machine);
        for (int q = 0; q < n; q++) {
            if (leg(arg, &p, from, path[q], q == n - 1, e) != 0) return -1;
            memcpy(at, path[q], sizeof at);
            from = at;
        }
    }
    return 0;
}

typedef struct limits {
    const double *lo, *hi;
} limits;

static int within(void *arg, const place *p, const double *from, const double to[2], int last, errmsg *e)
{
    const limits *l = arg;
    (void)from;
    for (int a = 0; a < 2; a++)
        if (!(to[a] >= l->lo[a] - 1e-6 && to[a] <= l->hi[a] + 1e-6))
            return err_set(e, "node %d,%d: expected %c from %g to %g mm, found %g%s", p->i, p->j, "xy"[a],
                           l -> lo[a], l -> hi[a], to[a], last ? "" : " (on the approach, see backlash)");
    return 0;
}

int plan_check_travel(const session *s, const double lo[2], const double hi[2], errmsg *e)
{
    limits l = {lo, hi};
    return walk(s, within, &l, e);
}

typedef struct sum {
    plan_totals *t;
    const session *s;
    plan_limits limits;
} sum;

static int add(void *arg, const place *p, const double *from, const double to[2], int last, errmsg *e)
{
    sum *u = arg;
    plan_totals *t = u->t;
    double mm = from ? hypot(to[0] - from[0], to[1] - from[1]) : 0;
    (void)p, (void)last, (void)e;
    t->moves++;
    t->distance_mm += mm;
    /* along a slanted move the axis that first comes to its limit decides */
    double feed = u->s->feed, acceleration = 0;
    for (int a = 0; a < 2; a++) {
        double share = from && mm > 0 ? fabs(to[a] - from[a]) / mm : 0;
        if (!(share > 0)) continue;
        if (u->limits.max_feed[a] > 0) feed = fmin(feed, u->limits.max_feed[a] / share);
        if (!(u->limits.acceleration[a] > 0)) continue;
        double most = u->limits.acceleration[a] / share;
        acceleration = acceleration > 0 ? fmin(acceleration, most) : most;
    }
    t->move_s += plan_move_seconds(mm, feed, u->s->acceleration > 0 ? u->s->acceleration : acceleration);
    for (int a = 0; a < 2; a++) {
        t->lo[a] = fmin(t->lo[a], to[a]);
        t->hi[a] = fmax(t->hi[a], to[a]);
    }
    return 0;
}

void plan_sum(plan_totals *t, const session *s, const plan_limits *of_stage)
{
    double series = 0;
    sum u = {t, s, *of_stage};
    memset(t, 0, sizeof *t);
    for (int a = 0; a < 2; a++) {
        t->lo[a] = INFINITY;
        t->hi[a] = -INFINITY;
    }
    walk(s, add, &u, NULL);
    for (int k = 0; k < s->exposures; k++) series += s->exposure[k];
    t->places = plan_places(s);
    t->exposures = t->places * s->exposures;
    t->settle_s = (double)t->places * s->settle;
    t->exposure_s = (double)t->places * series;
    t->overhead_s = (double)t->exposures * s->overhead;
    t->total_s = t->move_s + t->settle_s + t->exposure_s + t->overhead_s;
    t->bytes = (double)t->exposures * s->file_mb * 1e6;
}
