/*
 * sphere.c - occlusion cone and homography of a mirror-sphere array (sphere.h).
 */
#include "sphere.h"

#include <math.h>
#include <string.h>

#define DEG (M_PI / 180)

double sphere_free_cone(double k)
{
    if (!(k >= 1)) return NAN;
    double s = (1 + sqrt(1 + 16 * k * (2 * k - 1))) / (8 * k);
    return 2 * asin(s);
}

/* Unit square (0,0) (1,0) (1,1) (0,1) to a quadrilateral. */
static void square_to_quad(double h[9], const sphere_seen q[4])
{
    double sx = q[0].x - q[1].x + q[2].x - q[3].x, sy = q[0].y - q[1].y + q[2].y - q[3].y;
    double dx1 = q[1].x - q[2].x, dx2 = q[3].x - q[2].x, dy1 = q[1].y - q[2].y, dy2 = q[3].y - q[2].y;
    double det = dx1 * dy2 - dx2 * dy1, g = 0, k = 0;
    if (det != 0) {
        g = (sx * dy2 - dx2 * sy) / det;
        k = (dx1 * sy - sx * dy1) / det;
    }
    double r[9] = {q[1].x - q[0].x + g * q[1].x,
                   q[3].x - q[0].x + k * q[3].x,
                   q[0].x,
                   q[1].y - q[0].y + g * q[1].y,
                   q[3].y - q[0].y + k * q[3].y,
                   q[0].y,
                   g,
                   k,
                   1};
    memcpy(h, r, sizeof r);
}

/* Corners of a row or column become a quadrilateral by a step of one diameter to the side. */
static void widen(sphere_seen q[4], int n, int m, double rotate)
{
    double ux = cos(rotate), uy = sin(rotate); /* picture's +u if nothing else is known: right, turned back */
    if (n == 1 && m == 1) {
        double d = 2 * q[0].r;
        q[1] = q[2] = q[3] = q[0];
        q[1].x += d * ux, q[1].y += d * uy;
        q[3].x += d * uy, q[3].y -= d * ux;
        q[2].x = q[1].x + q[3].x - q[0].x, q[2].y = q[1].y + q[3].y - q[0].y;
    } else if (m == 1) { /* v is to the left of u (up, where u is right) */
        double dx = q[1].x - q[0].x, dy = q[1].y - q[0].y, k = 2 * q[0].r / hypot(dx, dy);
        q[3] = q[0], q[2] = q[1];
        q[3].x += k * dy, q[3].y -= k * dx;
        q[2].x += k * dy, q[2].y -= k * dx;
    } else if (n == 1) {
        double dx = q[3].x - q[0].x, dy = q[3].y - q[0].y, k = 2 * q[0].r / hypot(dx, dy);
        q[1] = q[0], q[2] = q[3];
        q[1].x -= k * dy, q[1].y += k * dx;
        q[2].x -= k * dy, q[2].y += k * dx;
    }
}

static int check_corners(const sphere_seen q[4], int n, int m, double rotate, errmsg *e)
{
    static const char *const which[] = {"(0,0)", "(n-1,0)", "(n-1,m-1)", "(0,m-1)"};
    double rmin = INFINITY, rmax = 0;
    int small = 0, big = 0;
    for (int i = 0; i < 4; i++) {
        if (!(q[i].r > 0) || !isfinite(q[i].x) || !isfinite(q[i].y) || !isfinite(q[i].r))
            return err_set(e, "corner %s: expected X,Y and a radius above 0, found %g,%g,%g", which[i],
                           q[i].x, q[i].y, q[i].r);
        if (q[i].r < rmin) rmin = q[i].r, small = i;
        if (q[i].r > rmax) rmax = q[i].r, big = i;
    }
    if (rmax > 1.5 * rmin)
        return err_set(e, "corners: expected radii alike within 1.5, found %g at %s and %g at %s", rmin,
                       which[small], rmax, which[big]);
    if (n == 1 && m == 1) return 0;
    double turn[4];
    int left = 0, right = 0;
    for (int i = 0; i < 4; i++) {
        const sphere_seen *a = q + (i + 3) % 4, *b = q + i, *c = q + (i + 1) % 4;
        turn[i] = (b->x - a->x) * (c->y - b->y) - (b->y - a->y) * (c->x - b->x);
        if (turn[i] < 0) left++; /* counter-clockwise on the screen, y down */
        else right++;
    }
    if (right == 4)
        return err_set(e, "corners: expected the order (0,0), (n-1,0), (n-1,m-1), (0,m-1) counter-clockwise "
                          "as seen from above, found it clockwise");
    if (left != 4) {
        int odd = 0;
        for (int i = 0; i < 4; i++)
            if ((turn[i] < 0) == (left == 1) || (left == 3 && turn[i] >= 0)) odd = i;
        return err_set(e, "corners: expected a convex quadrilateral, found %s at %g,%g on the wrong side",
                       which[odd], q[odd].x, q[odd].y);
    }
    double side[4], mean[2];
    for (int i = 0; i < 4; i++) side[i] = hypot(q[(i + 1) % 4].x - q[i].x, q[(i + 1) % 4].y - q[i].y);
    mean[0] = (side[0] + side[2]) / 2, mean[1] = (side[1] + side[3]) / 2;
    for (int i = 0; i < 4; i++)
        if (fabs(side[i] - mean[i % 2]) > 0.2 * mean[i % 2])
            return err_set(e,
                           "corners: expected opposite sides of like length, found %.0f px from %s to %s and "
                           "%.0f px opposite",
                           side[i], which[i], which[(i + 1) % 4], side[(i + 2) % 4]);
    double pitch[2] = {n > 1 ? mean[0] / (n - 1) : 0, m > 1 ? mean[1] / (m - 1) : 0}, d = rmin + rmax;
    for (int k = 0; k < 2; k++)
        if (pitch[k] > 0 && pitch[k] < 0.9 * d)
            return err_set(
                e, "corners: expected spheres at least a diameter (%.1f px) apart, found %.1f px along %c", d,
                pitch[k], "uv"[k]);
    double a = atan2(-(q[1].y - q[0].y), q[1].x - q[0].x) + rotate;
    a -= 2 * M_PI * nearbyint(a / (2 * M_PI));
    if (fabs(a) > 45 * DEG)
        return err_set(e,
                       "corners: expected +u, from (0,0) to (n-1,0), to point right in the picture, found it "
                       "%.0f degrees counter-clockwise from there; turn the picture with --rotate or name "
                       "the corners in the order (0,0), (n-1,0), (n-1,m-1), (0,m-1)",
                       a / DEG);
    return 0;
}

int sphere_grid_init(sphere_grid *g, int n, int m, const sphere_seen corner[4], double rotate, errmsg *e)
{
    sphere_seen q[4];
    memcpy(q, corner, sizeof q);
    for (int i = 0; i < 4; i++)
        if (!(q[i].r > 0)) return check_corners(q, n, m, rotate, e);
    widen(q, n, m, rotate);
    if (check_corners(q, n, m, rotate, e)) return -1;
    memset(g, 0, sizeof *g);
    g->n = n, g->m = m;
    square_to_quad(g->h, q);
    double du = n > 1 ? n - 1 : 1, dv = m > 1 ? m - 1 : 1;
    for (int k = 0; k < 3; k++) g->h[3 * k] /= du, g->h[3 * k + 1] /= dv;
    for (int k = 0; k < 4; k++) g->r[k] = q[k].r;
    return 0;
}

sphere_seen sphere_grid_at(double *u_angle, const sphere_grid *g, double s, double t)
{
    const double *h = g->h;
    double w = h[6] * s + h[7] * t + h[8], x = (h[0] * s + h[1] * t + h[2]) / w,
           y = (h[3] * s + h[4] * t + h[5]) / w;
    if (u_angle) *u_angle = atan2(-(h[3] - h[6] * y), h[0] - h[6] * x);
    double a = g->n > 1 ? s / (g->n - 1) : 0, b = g->m > 1 ? t / (g->m - 1) : 0;
    double r = (1 - b) * ((1 - a) * g->r[0] + a * g->r[1]) + b * ((1 - a) * g->r[3] + a * g->r[2]);
    return (sphere_seen){x, y, r};
}

double sphere_grid_pitch(const sphere_grid *g)
{
    double sum = 0;
    int count = 0;
    for (int j = 0; j < g->m; j++)
        for (int i = 0; i < g->n; i++) {
            sphere_seen a = sphere_grid_at(0, g, i, j);
            for (int k = 0; k < 2; k++) {
                if ((k ? j + 1 >= g->m : i + 1 >= g->n)) continue;
                sphere_seen b = sphere_grid_at(0, g, i + !k, j + k);
                sum += hypot(b.x - a.x, b.y - a.y) / (a.r + b.r);
                count++;
            }
        }
    return count ? sum / count : 0;
}
