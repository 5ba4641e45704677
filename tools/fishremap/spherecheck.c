/*
 * spherecheck.c - is a grid of spheres that was found without a hint the array? (spherefind.h)
 *
 * Asked of the picture anew, by another measure than the search's votes (rim.h): every sphere lies in the
 * picture; no larger circle about the same centres has the better rims, as a reflection's circle within a
 * ball would; and the rows and columns next to the grid are not spheres as well: then a shift by one pitch
 * would do as well, and which n x m are meant is not known.
 */
#include <math.h>
#include <stdlib.h>

#include "rim.h"
#include "spherefind.h"

#define WHOLE  1e6 /* pixels: no smaller copy */
#define BEYOND 0.7 /* of the outermost row's rims: what the next row beyond may have */
#define LARGER 1.1 /* times the rims found: what a larger circle may have */

/* How well a rim shows at a sphere, 0..1; NaN where a good part of it lies outside. */
static double rim_at_node(const rim_level *l, const sphere_grid *g, double i, double j, double grow)
{
    sphere_seen q = sphere_grid_at(NULL, g, i, j);
    double r = q.r * grow, best = 0;
    if (!(q.r > 0) || q.x - 0.8 * r < 0 || q.y - 0.8 * r < 0 || q.x + 0.8 * r > l->w || q.y + 0.8 * r > l->h)
        return NAN;
    for (int k = 0; k < 27; k++) /* neighbouring lines follow perspective within a pixel or so */
        best = fmax(best, rim_score(l, CIRCLE_BALL, q.x + k % 3 - 1, q.y + k / 3 % 3 - 1, r + k / 9 - 1));
    return best;
}

/* Mean over a line of nodes; NaN where most of it lies outside. */
static double rims_of_line(const rim_level *l, const sphere_grid *g, int i, int j, int along_u)
{
    double sum = 0;
    int n = along_u ? g->n : g->m, count = 0;
    for (int k = 0; k < n; k++) {
        double v = along_u ? rim_at_node(l, g, k, j, 1) : rim_at_node(l, g, i, k, 1);
        if (!isnan(v)) sum += v, count++;
    }
    return 2 * count > n ? sum / count : NAN;
}

static double rims_of_all(const rim_level *l, const sphere_grid *g, double grow)
{
    double sum = 0;
    int count = 0;
    for (int k = 0; k < g->n * g->m; k++) {
        double v = rim_at_node(l, g, k % g->n, k / g->n, grow);
        if (!isnan(v)) sum += v, count++;
    }
    return count ? sum / count : 0;
}

int sphere_check(const sphere_grid *g, const float *pix, int w, int h, errmsg *e)
{
    static const char *const side[4] = {"before the first column", "after the last column",
                                        "before the first row", "after the last row"};
    static const char hint[] = "give --corners X,Y,R of the four corner spheres";
    rim_pyramid p;
    int rc = 0;
    for (int k = 0; k < g->n * g->m; k++) {
        sphere_seen q = sphere_grid_at(NULL, g, k % g->n, k / g->n);
        if (fmin(fmin(q.x, q.y), fmin(w - q.x, h - q.y)) < 0.9 * q.r)
            return err_set(e,
                           "expected an array of %d x %d spheres within the picture, found a grid whose "
                           "sphere (%d,%d) at %.1f,%.1f radius %.1f is cut by the frame; %s",
                           g->n, g->m, k % g->n, k / g->n, q.x, q.y, q.r, hint);
    }
    float *grey = circle_grey(pix, w, h);
    if (!grey) return err_set(e, "out of memory");
    int failed = rim_pyramid_new(&p, grey, w, h, (int)WHOLE, e);
    free(grey);
    if (failed) return -1;
    const rim_level *l = &p.level[0];
    double here = rims_of_all(l, g, 1), pitch = sphere_grid_pitch(g);
    for (double grow = 1.12; !rc && grow < 1.02 * pitch; grow += 0.06) {
        double v = rims_of_all(l, g, grow);
        if (v > LARGER * here + 0.02)
            rc = err_set(e,
                         "expected the rims of %d x %d spheres, found better ones at %.2f times the radius "
                         "%.1f of the grid that repeats itself; %s",
                         g->n, g->m, grow, g->r[0], hint);
    }
    for (int k = 0; !rc && k < 4; k++) {
        int last = k & 1;
        double in = k < 2 ? rims_of_line(l, g, last ? g->n - 1 : 0, 0, 0)
                          : rims_of_line(l, g, 0, last ? g->m - 1 : 0, 1);
        double out =
            k < 2 ? rims_of_line(l, g, last ? g->n : -1, 0, 0) : rims_of_line(l, g, 0, last ? g->m : -1, 1);
        if (out > BEYOND * in)
            rc = err_set(e,
                         "expected %d x %d spheres and no more, found what looks like further ones %s (rims "
                         "%.2f, the outermost of the grid %.2f); %s",
                         g->n, g->m, side[k], out, in, hint);
    }
    rim_pyramid_free(&p);
    return rc;
}
