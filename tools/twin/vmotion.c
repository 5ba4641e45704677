/* vmotion.c - see vmotion.h. */
#include "vmotion.h"

#include <math.h>
#include <string.h>

void vmove_make(vmove *m, const double from[2], const double to[2], double feed, const double max_v[2],
                const double max_a[2], double start)
{
    memcpy(m->from, from, sizeof m->from);
    memcpy(m->to, to, sizeof m->to);
    m->length = hypot(to[0] - from[0], to[1] - from[1]);
    m->v = feed;
    m->a = INFINITY;
    m->start = start;
    m->brake = -1;
    for (int k = 0; k < 2; k++) {
        double share = m->length > 0 ? fabs(to[k] - from[k]) / m->length : 0;
        if (share > 0) {
            m->v = fmin(m->v, max_v[k] / share);
            m->a = fmin(m->a, max_a[k] / share);
        }
    }
    if (m->length > 0) m->v = fmin(m->v, sqrt(m->a * m->length));
}

/* Without a hold. */
static double rest_time(const vmove *m)
{
    return m->length > 0 ? m->length / m->v + m->v / m->a : 0;
}

static double free_run(const vmove *m, double t, double *speed)
{
    double ramp = m->v / m->a, total = rest_time(m);
    *speed = 0;
    if (!(m->length > 0) || t >= total) return m->length;
    if (t <= 0) return 0;
    if (t < ramp) {
        *speed = m->a * t;
        return m->a * t * t / 2;
    }
    if (t > total - ramp) {
        *speed = m->a * (total - t);
        return m->length - m->a * (total - t) * (total - t) / 2;
    }
    *speed = m->v;
    return m->v * (t - ramp / 2);
}

double vmove_at(const vmove *m, double t, double *speed)
{
    double v, held = m->brake - m->start;
    if (m->brake < 0 || t <= m->brake) return free_run(m, t - m->start, speed);
    double s = free_run(m, held, &v), dt = fmin(t - m->brake, v / m->a);
    if (!(m->length > 0)) dt = 0;
    *speed = v - m->a * dt;
    return dt > 0 ? s + v * dt - m->a * dt * dt / 2 : s;
}

double vmove_end(const vmove *m)
{
    double v;
    if (m->brake < 0) return m->start + rest_time(m);
    free_run(m, m->brake - m->start, &v);
    return m->brake + (v > 0 ? v / m->a : 0);
}

void vmove_position(double xy[2], const vmove *m, double t)
{
    double speed, s = vmove_at(m, t, &speed), f = m->length > 0 ? s / m->length : 1;
    for (int k = 0; k < 2; k++) xy[k] = f >= 1 ? m->to[k] : m->from[k] + f * (m->to[k] - m->from[k]);
}

void vmove_hold(vmove *m, double t)
{
    if (m->brake < 0) m->brake = t;
}
