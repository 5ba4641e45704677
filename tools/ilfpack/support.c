/*
 * support.c - see support.h.
 */
#include "support.h"

#include <math.h>
#include <string.h>

#include "ilflamps/vec.h"

enum { MOST_NODES = 64 };

int support_plane(double plane[9], const place *at, int n, const char *path, errmsg *e)
{
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300}, z = 0;

    for (int k = 0; k < n; k++) {
        for (int c = 0; c < 2; c++) lo[c] = fmin(lo[c], at[k].at[c]), hi[c] = fmax(hi[c], at[k].at[c]);
        z += at[k].at[2] / n;
    }
    const double wide = hi[0] - lo[0], high = hi[1] - lo[1];
    if (!(fmin(wide, high) > 1e-3 * fmax(wide, high)))
        return err_set(
            e,
            "%s: expected places that are spread over a plane, found them along a line of %.3g x %.3g "
            "(--plane says which rectangle is meant)",
            path, wide, high);
    const double p[9] = {lo[0], lo[1], z, wide, 0, 0, 0, high, 0};
    for (int k = 0; k < 9; k++) plane[k] = (double)(float)p[k];
    return 0;
}

static int bounded(double n)
{
    return n < 2 ? 2 : n > MOST_NODES ? MOST_NODES : (int)lround(n);
}

void support_grid(int *n_u, int *n_v, const ilf_frame *plane, int n)
{
    const double ratio = plane->len_u / plane->len_v;

    *n_u = bounded(sqrt(n * ratio));
    *n_v = bounded((double)n / *n_u);
}

/* Number of a place's strip, and its way along it, from the side where the strip begins. */
static void along(double key[2], const place *p, const ilf_frame *plane, int strips)
{
    double off[3];

    v_sub(off, p->at, plane->origin);
    const double s = v_dot(off, plane->u), t = v_dot(off, plane->v) / plane->len_v;
    key[0] = floor(fmax(0, fmin(.999, t)) * strips);
    key[1] = fmod(key[0], 2) > 0 ? -s : s;
}

void support_order(place *at, char **pictures, int n, const ilf_frame *plane)
{
    const int strips = bounded(sqrt(n));

    for (int i = 1; i < n; i++) /* few: insertion */
        for (int k = i; k > 0; k--) {
            double a[2], b[2];
            along(a, &at[k - 1], plane, strips), along(b, &at[k], plane, strips);
            if (a[0] < b[0] || (a[0] <= b[0] && a[1] <= b[1])) break;
            const place p = at[k];
            char *name = pictures[k];
            at[k] = at[k - 1], at[k - 1] = p;
            pictures[k] = pictures[k - 1], pictures[k - 1] = name;
        }
}
