/*
 * ilf_mask.c - what lets a lamp's light through: sheets, beams, gates, balls (ilf_luminaire.h has the
 * drawing).
 */
#include <math.h>

#include "ilf_luminaire.h"

static double logistic(double g)
{
    return 1 / (1 + exp(-g));
}

static double bounded(double x, double lo, double hi)
{
    return x > lo ? x < hi ? x : hi : lo;
}

static double sampled(const ilf_mask *m, const float *grid, double x, double y)
{
    const double s = bounded((x - m->x0) / m->dx, 0, m->nx - 1),
                 t = bounded((y - m->y0) / m->dy, 0, m->ny - 1);
    const int i = s < m->nx - 1 ? (int)s
                  : m->nx > 1   ? m->nx - 2
                                : 0,
              j = t < m->ny - 1 ? (int)t
                  : m->ny > 1   ? m->ny - 2
                                : 0;
    const double a = s - i, b = t - j;
    const float *g = grid + (long)j * m->nx + i;
    const int right = m->nx > 1, up = m->ny > 1 ? m->nx : 0;

    return (1 - b) * ((1 - a) * (double)g[0] + a * (double)g[right]) +
           b * ((1 - a) * (double)g[up] + a * (double)g[up + right]);
}

static double picture(const ilf_mask *m, double x, double y)
{
    const double v = sampled(m, m->grid, x, y);

    return m->link == ILF_LINK_LOGISTIC ? logistic(v) : v;
}

static void foot(double f[2], const ilf_mask *m, const double c[3], const double o[3], const double d[3])
{
    const double down = -o[2] / d[2], up = (c[2] - o[2]) / d[2];

    for (int k = 0; k < 2; k++) f[k] = o[k] + down * d[k] + m->beta * (o[k] + up * d[k] - c[k]);
}

static double layer(const ilf_mask *m, const double c[3], const double o[3], const double d[3])
{
    const double rise = d[2] - m->plane[1] * d[0] - m->plane[2] * d[1];
    const double gap = m->plane[0] + m->plane[1] * o[0] + m->plane[2] * o[1] - o[2], t = gap / rise;

    if (gap <= 0 || rise <= 0 || o[2] + t * d[2] >= c[2]) return 1;
    return picture(m, o[0] + t * d[0], o[1] + t * d[1]);
}

static double gate(const ilf_mask *m, const double c[3], const double o[3], const double d[3])
{
    double f[2];

    foot(f, m, c, o, d);
    const double x = f[0], y = f[1];
    return logistic(m->coef[0] + m->coef[1] * x + m->coef[2] * y + m->coef[3] * x * x + m->coef[4] * x * y +
                    m->coef[5] * y * y);
}

static double stack(const ilf_mask *m, const double c[3], const double o[3], const double d[3])
{
    const double down = -o[2] / d[2], up = (c[2] - o[2]) / d[2];
    const double p[2] = {o[0] + down * d[0], o[1] + down * d[1]},
                 q[2] = {o[0] + up * d[0] - c[0], o[1] + up * d[1] - c[1]};
    double most = 0;

    for (int k = 0; k < m->nz; k++) {
        const double t = m->nz > 1 ? (double)k / (m->nz - 1) : 0,
                     h = 1 / ((1 - t) / m->plane[0] + t / m->plane[1]);
        const double beta = h / (c[2] - h);
        if (h <= o[2] || h >= c[2]) continue;
        most =
            fmax(most, sampled(m, m->grid + (long)k * m->nx * m->ny, p[0] + beta * q[0], p[1] + beta * q[1]));
    }
    return logistic((m->coef[0] - most) / m->coef[1]);
}

static double ball(const ilf_mask *m, const double c[3], const double o[3], const double d[3])
{
    double e[3], ee = 0, t = 0;

    for (int k = 0; k < 3; k++) e[k] = m->coef[k] - o[k], t += e[k] * d[k], ee += e[k] * e[k];
    const double beside = ee - t * t, lamp = (c[2] - o[2]) / d[2];
    return t > 0 && t < lamp && beside < m->coef[3] * m->coef[3] ? 0 : 1;
}

double ilf_mask_pass(const ilf_mask *m, const double c[3], const double o[3], const double d[3])
{
    double f[2];

    switch (m->kind) {
    case ILF_MASK_LAYER: return layer(m, c, o, d);
    case ILF_MASK_GATE: return gate(m, c, o, d);
    case ILF_MASK_BEAM:
        return m->coef[4] *
               pow(fmax(0, -(d[0] * m->coef[0] + d[1] * m->coef[1] + d[2] * m->coef[2])), m->coef[3]);
    case ILF_MASK_STACK: return stack(m, c, o, d);
    case ILF_MASK_BALL: return ball(m, c, o, d);
    default: foot(f, m, c, o, d); return picture(m, f[0], f[1]);
    }
}

double ilf_luminaire_pass(const ilf_luminaire *l, const double o[3], const double d[3])
{
    double product = 1, sum = 0;

    for (int k = 0; k < l->nmasks; k++) {
        const double v = ilf_mask_pass(&l->masks[k], l->centre, o, d);
        if (l->masks[k].adds) sum += v;
        else product *= v;
    }
    return fmax(0, product + sum);
}
