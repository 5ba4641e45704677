/*
 * plan.h - the way over the grid: order, targets, approach, travel, time and space (pure).
 *
 * Node (i, j) stands i/(n-1) of U and j/(m-1) of V from the plane's corner O; a single row or column stands
 * in the middle (docs/FORMAT.md, section 1.3).  Machine coordinates are mm.
 */
#ifndef PLAN_H
#define PLAN_H

#include "session.h"

typedef struct place {
    long index;        /* 0.. in the order of the visit */
    int i, j;          /* node */
    double plane[2];   /* lengths along U and V from O, scene units */
    double machine[2]; /* target, mm */
} place;

long plan_places(const session *s);
void plan_place(place *p, const session *s, long index);

/* Machine position -> lengths along U and V, scene units. */
void plan_on_plane(double plane[2], const session *s, const double machine[2]);

/* Points to pass for reaching the target from `from` (NULL: from anywhere, coming to the end of an axis's
 * play unknown) such that each axis arrives in the direction of its backlash's sign.  Returns 1 or 2 points.
 */
int plan_path(double path[2][2], const session *s, const double *from, const double target[2]);

/* All targets and all points passed lie within lo..hi (mm).  The words name the first that does not. */
int plan_check_travel(const session *s, const double lo[2], const double hi[2], errmsg *e);

typedef struct plan_totals {
    long places, exposures, moves;
    double distance_mm, move_s, settle_s, exposure_s, overhead_s, total_s; /* from the first place on */
    double bytes;
    double lo[2], hi[2]; /* what the moves span, mm */
} plan_totals;

/* What a stage can do along each machine axis; 0 = unknown: no limit, and no time for speeding up. */
typedef struct plan_limits {
    double max_feed[2];     /* mm/min */
    double acceleration[2]; /* mm/s2 */
} plan_limits;

/* Straight moves from rest to rest.  The session's own acceleration, where given, wins. */
void plan_sum(plan_totals *t, const session *s, const plan_limits *of_stage);

/* Time of one straight move from rest to rest:
 *
 *   v ^    ____        d >= v^2/a:  d/v + v/a
 *     |   /    \       else the feed is not reached: 2 sqrt(d/a)
 *     +--/------\-->   */
double plan_move_seconds(double mm, double feed_mm_min, double acceleration);

#endif
