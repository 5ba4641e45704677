/*
 * deadline.h - points in time that survive interrupted and partial calls: seconds of CLOCK_MONOTONIC.
 */
#ifndef DEADLINE_H
#define DEADLINE_H

#include <math.h>
#include <time.h>

static inline double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* What is left until then as a timeout of poll(): rounded up, never negative. */
static inline int left_ms(double deadline_s)
{
    double ms = ceil((deadline_s - now_s()) * 1000);
    return ms <= 0 ? 0 : ms > 1e8 ? 100000000 : (int)ms;
}

#endif
