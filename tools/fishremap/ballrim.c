/*
 * ballrim.c - votes for a mirror ball's rim (ballrim.h).
 */
#include "ballrim.h"

#include <math.h>
#include <string.h>

#define ANGLES 96

/* How well a ball's rim shows at a circle: the mean over the rays of how much more the picture changes across
 * it than beyond it (log ratio, at most 2 either way), times the radius, as of two rims the outer one holds
 * the inner as a reflection, and less the more of it is outside the picture: there it says nothing.  b: half
 * the width, in pixels, over which a change is seen; what is beyond begins where the edge's own blur has
 * ended. */
static double rim_votes(const rim_level *l, const double c[3], double b)
{
    static double co[ANGLES], si[ANGLES];
    double from[4] = {-b, b, fmax(1.5 * b, 2.5), 0}, sum = 0;
    int seen = 0;
    from[3] = from[2] + 3 * b;
    if (co[0] == 0)
        for (int k = 0; k < ANGLES; k++)
            co[k] = cos(2 * M_PI * k / ANGLES), si[k] = sin(2 * M_PI * k / ANGLES);
    for (int k = 0; k < ANGLES; k++) {
        float v[4];
        for (int i = 0; i < 4; i++)
            v[i] = rim_grey(l, c[0] + (c[2] + from[i]) * co[k], c[1] + (c[2] + from[i]) * si[k]);
        if (isnan(v[0]) || isnan(v[3])) continue;
        sum += fmax(-2, fmin(2, log(((double)fabsf(v[1] - v[0]) + 0.02) /
                                    ((double)fabsf(v[3] - v[2]) / 1.5 + 0.02))));
        seen++;
    }
    return seen < ANGLES / 4 ? 0 : sum / seen * c[2] * sqrt((double)seen / ANGLES);
}

/* Uphill in the votes, which are seen ever finer. */
static void climb_votes(double c[3], const rim_level *l)
{
    double b = fmax(c[2] / 65, 1);
    for (int last = 0; !last; b = fmax(b / M_SQRT2, 1)) {
        last = b == 1;
        double best = rim_votes(l, c, b);
        for (double step = b / 2; step > b / 20; step /= 2)
            for (int moved = 1, it = 0; moved && it < 20; it++) {
                double o[3] = {c[0], c[1], c[2]};
                moved = 0;
                for (int m = 0; m < 27; m++) {
                    double t[3] = {o[0] + step * (m % 3 - 1), o[1] + step * (m / 3 % 3 - 1),
                                   o[2] + step * (m / 9 - 1)};
                    double v = rim_votes(l, t, b);
                    if (v > best) best = v, memcpy(c, t, sizeof t), moved = 1;
                }
            }
    }
}

int ball_cut_out(double c[3], int w, int h)
{
    double wide = fmax(fabs(w - 2 * c[2]), fabs(h - 2 * c[2])),
           off = fmax(fabs(w / 2. - c[0]), fabs(h / 2. - c[1]));
    if (!(wide < 0.03 * c[2] && off < 0.03 * c[2])) return 0;
    c[2] = fmin(c[2], (w < h ? w : h) / 2. - 0.5);
    c[0] = fmax(c[2] + 0.5, fmin(w - c[2] - 0.5, c[0])), c[1] = fmax(c[2] + 0.5, fmin(h - c[2] - 0.5, c[1]));
    return 1;
}

void ball_rim(double c[3], const rim_level *l)
{
    double t[3] = {c[0], c[1], c[2]}, step = fmax(c[2] / 130, 0.5), b = fmax(c[2] / 65, 0.5),
           best = 1.25 * rim_votes(l, c, b);
    for (int r = -2; r <= 9; r++)
        for (int y = -9; y <= 9; y++)
            for (int x = -9; x <= 9; x++) {
                double o[3] = {c[0] + x * step, c[1] + y * step, c[2] + r * step}, v = rim_votes(l, o, b);
                if (v > best) best = v, memcpy(t, o, sizeof t);
            }
    climb_votes(t, l);
    memcpy(c, t, sizeof t);
}
