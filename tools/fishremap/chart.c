/*
 * chart.c - direction <-> pixel for lens discs and longitude grids (chart.h).
 */
#include "chart.h"

#include <math.h>
#include <string.h>

static void rows_from(double frame[3][3], const double right[3], const double up[3], const double axis[3])
{
    memcpy(frame[0], right, sizeof frame[0]);
    memcpy(frame[1], up, sizeof frame[1]);
    memcpy(frame[2], axis, sizeof frame[2]);
}

static void set_shape(chart *c, const double s[2][2])
{
    double det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    if (det == 0) { /* none stated */
        c->shape[0][0] = c->shape[1][1] = c->unshape[0][0] = c->unshape[1][1] = 1;
        return;
    }
    memcpy(c->shape, s, sizeof c->shape);
    c->unshape[0][0] = s[1][1] / det, c->unshape[0][1] = -s[0][1] / det;
    c->unshape[1][0] = -s[1][0] / det, c->unshape[1][1] = s[0][0] / det;
}

void chart_disc(chart *c, int width, int height, const lens *l, double cx, double cy, double radius,
                int mirror, double rotate, double tilt, double tilt_to)
{
    const double right[3] = {mirror ? 1 : -1, 0, 0}, up[3] = {0, 1, 0}, axis[3] = {0, 0, 1};
    memset(c, 0, sizeof *c);
    c->kind = CHART_DISC;
    c->width = width, c->height = height;
    c->lens = *l;
    c->cx = cx, c->cy = cy, c->radius = radius;
    set_shape(c, l->shape);
    rows_from(c->frame, right, up, axis);
    chart_turn(c, mirror, rotate, tilt, tilt_to);
}

void chart_turn(chart *c, int mirror, double rotate, double tilt, double tilt_to)
{
    double sign = mirror ? 1 : -1;
    /* Right and up of the upright picture, then where these lie in the picture as taken: turning the
     * picture by +rotate brings a point at azimuth psi - rotate to psi. */
    double right[3] = {sign * cos(rotate), sin(rotate), 0};
    double up[3] = {-sign * sin(rotate), cos(rotate), 0};
    double axis[3] = {0, 0, 1};
    /* Lean of the axis within the plane of axis and lean: both turn by tilt. */
    double ca = cos(tilt_to), sa = sin(tilt_to), ct = cos(tilt), st = sin(tilt);
    double lean[3] = {sign * ca, sa, 0};
    double moved_axis[3], r2[3], u2[3];
    for (int k = 0; k < 3; k++) {
        moved_axis[k] = ct * axis[k] + st * lean[k];
        double moved_lean = ct * lean[k] - st * axis[k];
        double rl = right[0] * lean[0] + right[1] * lean[1], ul = up[0] * lean[0] + up[1] * lean[1];
        r2[k] = right[k] + rl * (moved_lean - lean[k]);
        u2[k] = up[k] + ul * (moved_lean - lean[k]);
    }
    for (int i = 0; i < 3; i++) { /* u, v and n of the frame go where right, up and axis went */
        double f[3] = {sign * c->frame[i][0], c->frame[i][1], c->frame[i][2]};
        for (int k = 0; k < 3; k++) c->frame[i][k] = f[0] * r2[k] + f[1] * u2[k] + f[2] * moved_axis[k];
    }
}

void chart_face(chart *c, double heading)
{
    const double ch = cos(heading), sh = sin(heading);
    for (int i = 0; i < 3; i++) {
        double u = c->frame[i][0], v = c->frame[i][1], n = c->frame[i][2];
        c->frame[i][0] = ch * n - sh * u, c->frame[i][1] = sh * n + ch * u, c->frame[i][2] = v;
    }
}

void chart_probe(chart *c, int width, int height, double polar_max)
{
    static const double u[3] = {1, 0, 0}, v[3] = {0, 1, 0}, n[3] = {0, 0, 1};
    memset(c, 0, sizeof *c);
    c->kind = CHART_GRID;
    c->width = width, c->height = height;
    rows_from(c->frame, u, v, n);
    c->lon0 = -M_PI, c->lon_span = 2 * M_PI, c->polar_max = polar_max;
}

void chart_latlong(chart *c, int width, int height, double lon0, double span, double top, double bottom)
{
    /* longitude 0 along n, 90 degrees along the picture's right, pole at v */
    static const double n[3] = {0, 0, 1}, right[3] = {-1, 0, 0}, v[3] = {0, 1, 0};
    memset(c, 0, sizeof *c);
    c->kind = CHART_GRID;
    c->width = width, c->height = height;
    rows_from(c->frame, n, right, v);
    c->lon0 = lon0, c->lon_span = span, c->polar_min = top, c->polar_max = bottom;
}

double chart_row_step(const chart *c)
{
    return (c->polar_max - c->polar_min) / c->height;
}

double chart_pole(const chart *c, int lower)
{
    return ((lower ? M_PI : 0) - c->polar_min) / chart_row_step(c);
}

int chart_whole(const chart *c)
{
    return c->kind == CHART_GRID && c->lon_span > 2 * M_PI * (1 - 1e-12) && c->polar_min < M_PI * 1e-12 &&
           c->polar_max > M_PI * (1 - 1e-12);
}

void chart_disc_place(double *x, double *y, const chart *c, double px, double py)
{
    double dx = (px - c->cx) / c->radius, dy = (c->cy - py) / c->radius;
    *x = c->unshape[0][0] * dx + c->unshape[0][1] * dy;
    *y = c->unshape[1][0] * dx + c->unshape[1][1] * dy;
}

int chart_project(double xy[2], const chart *c, const double d[3])
{
    double p[3];
    for (int k = 0; k < 3; k++) p[k] = c->frame[k][0] * d[0] + c->frame[k][1] * d[1] + c->frame[k][2] * d[2];
    double h = sqrt(p[0] * p[0] + p[1] * p[1]), theta = atan2(h, p[2]);
    if (c->kind == CHART_GRID) {
        double lon = atan2(p[1], p[0]);
        if (lon < c->lon0) lon += 2 * M_PI;
        xy[0] = (lon - c->lon0) * c->width / c->lon_span;
        xy[1] = (theta - c->polar_min) / chart_row_step(c);
        return lon - c->lon0 <= c->lon_span && theta >= c->polar_min && theta <= c->polar_max;
    }
    double r = c->radius * lens_radius(0, &c->lens, theta);
    double s = h > 0 ? r / h : 0;
    double x = h > 0 ? s * p[0] : r, y = s * p[1];
    xy[0] = c->cx + c->shape[0][0] * x + c->shape[0][1] * y;
    xy[1] = c->cy - c->shape[1][0] * x - c->shape[1][1] * y;
    return theta <= c->lens.half;
}

int chart_unproject(double d[3], const chart *c, double x, double y)
{
    double p[3], theta, cl, sl;
    int inside = 1;
    if (c->kind == CHART_GRID) {
        double lon = c->lon0 + x * c->lon_span / c->width;
        theta = c->polar_min + y * (c->polar_max - c->polar_min) / c->height;
        cl = cos(lon), sl = sin(lon);
    } else {
        double dx, dy;
        chart_disc_place(&dx, &dy, c, x, y);
        double r = hypot(dx, dy);
        theta = lens_angle(&c->lens, r);
        inside = r <= 1;
        cl = r > 0 ? dx / r : 1, sl = r > 0 ? dy / r : 0;
    }
    p[0] = sin(theta) * cl, p[1] = sin(theta) * sl, p[2] = cos(theta);
    for (int k = 0; k < 3; k++) d[k] = p[0] * c->frame[0][k] + p[1] * c->frame[1][k] + p[2] * c->frame[2][k];
    return inside;
}

double chart_disc_scale(const chart *c)
{
    return c->radius * c->radius * (c->shape[0][0] * c->shape[1][1] - c->shape[0][1] * c->shape[1][0]);
}

double chart_pixel_solid_angle(const chart *c, int x, int y)
{
    if (c->kind == CHART_GRID) {
        double step = chart_row_step(c);
        return c->lon_span / c->width * 2 * sin(c->polar_min + step * (y + 0.5)) * sin(step / 2);
    }
    double px, py;
    chart_disc_place(&px, &py, c, x + 0.5, y + 0.5);
    double r = hypot(px, py);
    return r <= 1 ? lens_solid_angle(&c->lens, r) / chart_disc_scale(c) : 0;
}
