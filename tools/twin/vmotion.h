/*
 * vmotion.h - how the virtual stage moves: straight lines from rest to rest (pure).
 *
 *   v ^     ________ v           s(t) while accelerating  a t^2 / 2
 *     |    /        \            cruising                 v (t - v / 2a)
 *     |  a/          \ -a        braking                  length - a (T - t)^2 / 2
 *     +--/------------\--> t     short moves peak at sqrt(a length)
 *        0            T
 *
 * A hold brakes with a from wherever the move is; that always ends before the target.
 */
#ifndef VMOTION_H
#define VMOTION_H

typedef struct vmove {
    double from[2], to[2]; /* mm */
    double length;         /* mm */
    double v, a;           /* mm/s reached, mm/s2 */
    double start;          /* s, simulated */
    double brake;          /* s, when a hold began; < 0 = none */
} vmove;

/* A move under the axes' limits (mm/s, mm/s2). */
void vmove_make(vmove *m, const double from[2], const double to[2], double feed_mm_s, const double max_v[2],
                const double max_a[2], double start);
double vmove_end(const vmove *m); /* time when it rests */
/* Distance along the way and speed at a time. */
double vmove_at(const vmove *m, double t, double *speed);
void vmove_position(double xy[2], const vmove *m, double t);
void vmove_hold(vmove *m, double t);

#endif
