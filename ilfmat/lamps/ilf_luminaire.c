/*
 * ilf_luminaire.c - rays that meet lamps; how large lamps look; directions towards them.
 */
#include "ilf_luminaire.h"

#include <math.h>
#include <string.h>

#include "ilf_vec.h"

static const double pi = 3.14159265358979323846;

static double away(double e[3], const ilf_luminaire *l, const double o[3])
{
    for (int k = 0; k < 3; k++) e[k] = l->centre[k] - o[k];
    return sqrt(dot(e, e));
}

static int hit_ball(double *t, const double e[3], double radius, const double d[3])
{
    const double m = dot(e, d), x = e[0] - m * d[0], y = e[1] - m * d[1], z = e[2] - m * d[2];
    const double q = radius * radius - (x * x + y * y + z * z);

    if (!(q > 0) || !(m - sqrt(q) > 0)) return 0; /* nor for numbers that overflowed */
    *t = m - sqrt(q);
    return 1;
}

static int hit_flat(double *t, const ilf_luminaire *l, const double e[3], const double d[3])
{
    double n[3], h[3];

    cross(n, l->a, l->b);
    const double dn = dot(d, n), at = dot(e, n) / dn;
    if (dn == 0 || !(at > 0)) return 0;
    for (int k = 0; k < 3; k++) h[k] = at * d[k] - e[k];
    const double s = dot(h, l->a) / dot(l->a, l->a), q = dot(h, l->b) / dot(l->b, l->b);
    if (l->shape == ILF_RECTANGLE ? fabs(s) > 1 || fabs(q) > 1 : s * s + q * q > 1) return 0;
    *t = at;
    return 1;
}

/* A cylinder between centre -+ a, with half balls at its ends. */
static int hit_tube(double *t, const ilf_luminaire *l, const double e[3], const double d[3])
{
    const double aa = dot(l->a, l->a), ad = dot(l->a, d), ae = -dot(l->a, e), ee = dot(e, e), ed = -dot(e, d);
    const double A = aa - ad * ad, B = aa * ed - ae * ad, C = aa * (ee - l->radius * l->radius) - ae * ae;
    const double h = B * B - A * C;
    double s = 0, end[3];

    if (A > 0) {
        if (h < 0) return 0;
        const double at = (-B - sqrt(h)) / A;
        s = ae + at * ad;
        if (fabs(s) <= aa) {
            if (at <= 0) return 0;
            *t = at;
            return 1;
        }
    }
    for (int k = 0; k < 3; k++) end[k] = e[k] + (s < 0 ? -l->a[k] : l->a[k]);
    return hit_ball(t, end, l->radius, d);
}

int ilf_luminaire_hit(double *t, const ilf_luminaire *l, const double o[3], const double d[3])
{
    double e[3];

    away(e, l, o);
    if (l->shape == ILF_SPHERE) return hit_ball(t, e, l->radius, d);
    return l->shape == ILF_TUBE ? hit_tube(t, l, e, d) : hit_flat(t, l, e, d);
}

double ilf_luminaire_extent(const ilf_luminaire *l)
{
    const double a = dot(l->a, l->a), b = dot(l->b, l->b);

    if (l->shape == ILF_SPHERE) return l->radius;
    if (l->shape == ILF_TUBE) return sqrt(a) + l->radius;
    return l->shape == ILF_DISC ? sqrt(fmax(a, b)) : sqrt(a + b);
}

double ilf_luminaire_cone(const ilf_luminaire *l, const double o[3])
{
    double e[3];
    const double far = away(e, l, o), r = ilf_luminaire_extent(l);

    return far > r ? asin(r / far) : pi;
}

/* Solid angle of a triangle, van Oosterom and Strackee 1983; corners as seen from the eye. */
static double triangle(const double a[3], const double b[3], const double c[3])
{
    double n[3];
    const double la = sqrt(dot(a, a)), lb = sqrt(dot(b, b)), lc = sqrt(dot(c, c));

    cross(n, b, c);
    return 2 * atan2(fabs(dot(a, n)), la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la);
}

static double omega_rectangle(const ilf_luminaire *l, const double e[3])
{
    double p[4][3];

    for (int k = 0; k < 3; k++) {
        p[0][k] = e[k] - l->a[k] - l->b[k], p[1][k] = e[k] + l->a[k] - l->b[k];
        p[2][k] = e[k] + l->a[k] + l->b[k], p[3][k] = e[k] - l->a[k] + l->b[k];
    }
    return triangle(p[0], p[1], p[2]) + triangle(p[0], p[2], p[3]);
}

/* A polygon of as many sides, of the ellipse's own area. */
static double omega_disc(const ilf_luminaire *l, const double e[3])
{
    enum { SIDES = 48 };
    const double step = 2 * pi / SIDES, grow = sqrt(step / sin(step));
    double sum = 0, p[2][3];

    for (int i = 0; i <= SIDES; i++) {
        const double c = grow * cos(i * step), s = grow * sin(i * step);
        for (int k = 0; k < 3; k++) p[i & 1][k] = e[k] + c * l->a[k] + s * l->b[k];
        if (i) sum += triangle(e, p[0], p[1]);
    }
    return sum;
}

/* Across the axis: half width of the outline at a place along it is an angle asin(r / distance). */
static double omega_tube(const ilf_luminaire *l, const double e[3])
{
    enum { STEPS = 64 };
    const double half = sqrt(dot(l->a, l->a)), r = l->radius;
    double sum = 0;

    for (int i = 0; i < STEPS; i++) {
        const double s = (2 * (i + .5) / STEPS - 1);
        double q[3];
        for (int k = 0; k < 3; k++) q[k] = e[k] + s * l->a[k];
        const double far = sqrt(dot(q, q)), along = half > 0 ? dot(q, l->a) / (half * far) : 0;
        sum += 2 * r / (far * far) * sqrt(fmax(0, 1 - along * along));
    }
    const double far2 = dot(e, e);
    return sum * 2 * half / STEPS + (far2 > r * r ? 2 * pi * (1 - sqrt(1 - r * r / far2)) : 0);
}

double ilf_luminaire_omega(const ilf_luminaire *l, const double o[3])
{
    double e[3];
    const double far = away(e, l, o), x = l->radius / far;

    if (l->shape == ILF_RECTANGLE) return omega_rectangle(l, e);
    if (l->shape == ILF_DISC) return omega_disc(l, e);
    if (l->shape == ILF_TUBE) return omega_tube(l, e);
    return far > l->radius ? 2 * pi * x * x / (1 + sqrt(1 - x * x)) : 4 * pi;
}

double ilf_luminaire_surface(const ilf_luminaire *l)
{
    const double a = sqrt(dot(l->a, l->a)), b = sqrt(dot(l->b, l->b)), r = l->radius;

    if (l->shape == ILF_SPHERE) return 4 * pi * r * r;
    if (l->shape == ILF_TUBE) return 2 * pi * r * 2 * a + 4 * pi * r * r;
    return l->shape == ILF_DISC ? pi * a * b : 4 * a * b;
}

/* Two unit vectors at right angles to n. */
static void basis(double x[3], double y[3], const double n[3])
{
    const double s = n[2] < 0 ? -1 : 1, a = -1 / (s + n[2]), b = n[0] * n[1] * a;

    x[0] = 1 + s * n[0] * n[0] * a, x[1] = s * b, x[2] = -s * n[0];
    y[0] = b, y[1] = s + n[1] * n[1] * a, y[2] = -n[1];
}

static double sample_sphere(double d[3], const ilf_luminaire *l, const double e[3], double far, double s,
                            double t)
{
    const double q = l->radius / far, gap = q * q / (1 + sqrt(1 - q * q)), z = 1 - s * gap;
    const double r = sqrt(fmax(0, (1 - z) * (1 + z))), phi = 2 * pi * t;
    double n[3], x[3], y[3];

    for (int k = 0; k < 3; k++) n[k] = e[k] / far;
    basis(x, y, n);
    for (int k = 0; k < 3; k++) d[k] = r * cos(phi) * x[k] + r * sin(phi) * y[k] + z * n[k];
    return 1 / (2 * pi * gap);
}

static double bounded(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* Urena, Fajardo, King, "An area-preserving parametrization for spherical rectangles", 2013; a, b at right
 * angles. */
static double sample_rectangle(double d[3], const double a[3], const double b[3], const double e[3], double s,
                               double t)
{
    const double la = sqrt(dot(a, a)), lb = sqrt(dot(b, b));
    double x[3], y[3], z[3];

    for (int k = 0; k < 3; k++) x[k] = a[k] / la, y[k] = b[k] / lb;
    cross(z, x, y);
    double z0 = dot(e, z);
    if (z0 > 0)
        for (int k = 0; k < 3; k++) z[k] = -z[k];
    z0 = -fabs(z0);
    if (z0 > -1e-12 * (la + lb)) return 0;
    const double x0 = dot(e, x) - la, x1 = x0 + 2 * la, y0 = dot(e, y) - lb, y1 = y0 + 2 * lb;
    /* z components of the normals of the four sides' planes */
    const double n0 = -y0 / sqrt(z0 * z0 + y0 * y0), n1 = x1 / sqrt(z0 * z0 + x1 * x1);
    const double n2 = y1 / sqrt(z0 * z0 + y1 * y1), n3 = -x0 / sqrt(z0 * z0 + x0 * x0);
    const double g0 = acos(bounded(-n0 * n1, -1, 1)), g1 = acos(bounded(-n1 * n2, -1, 1));
    const double g2 = acos(bounded(-n2 * n3, -1, 1)), g3 = acos(bounded(-n3 * n0, -1, 1));
    const double k0 = 2 * pi - g2 - g3, omega = g0 + g1 - k0;
    if (!(omega > 0)) return 0;
    const double au = s * omega + k0, fu = (cos(au) * n0 - n2) / sin(au);
    const double cu = bounded((fu > 0 ? 1 : -1) / sqrt(fu * fu + n0 * n0), -1, 1);
    const double xu = bounded(-(cu * z0) / fmax(sqrt(1 - cu * cu), 1e-300), x0, x1),
                 dist = sqrt(xu * xu + z0 * z0);
    const double h0 = y0 / sqrt(dist * dist + y0 * y0), h1 = y1 / sqrt(dist * dist + y1 * y1),
                 hv = h0 + t * (h1 - h0);
    const double yv = hv * hv < 1 - 1e-12 ? hv * dist / sqrt(1 - hv * hv) : y1,
                 len = sqrt(xu * xu + yv * yv + z0 * z0);
    for (int k = 0; k < 3; k++) d[k] = (xu * x[k] + yv * y[k] + z0 * z[k]) / len;
    return 1 / omega;
}

static double sample_disc(double d[3], const ilf_luminaire *l, const double e[3], double s, double t)
{
    const double r = sqrt(s), c = r * cos(2 * pi * t), q = r * sin(2 * pi * t);
    double n[3], p[3];

    cross(n, l->a, l->b);
    const double area = sqrt(dot(n, n));
    for (int k = 0; k < 3; k++) p[k] = e[k] + c * l->a[k] + q * l->b[k];
    const double len2 = dot(p, p), len = sqrt(len2);
    for (int k = 0; k < 3; k++) d[k] = p[k] / len;
    const double facing = fabs(dot(d, n)) / area;
    return facing > 0 ? len2 / (facing * pi * area) : 0;
}

/* The rectangle across the line of sight, through the axis' middle, as wide and long as the outline's shadow
 * on it. */
static double sample_tube(double d[3], const ilf_luminaire *l, const double o[3], const double e[3],
                          double far, double s, double t)
{
    const double half = sqrt(dot(l->a, l->a));
    double x[3], y[3], n[3], hit;

    for (int k = 0; k < 3; k++) n[k] = e[k] / far;
    cross(y, n, l->a);
    double ly = sqrt(dot(y, y));
    if (ly < 1e-6 * half || half == 0) basis(x, y, n);
    else {
        for (int k = 0; k < 3; k++) y[k] /= ly;
        cross(x, y, n);
    }
    const double near = fmax(far - half - l->radius, .1 * far), grow = far / near;
    const double wide = l->radius * grow * 1.01, length = (fabs(dot(x, l->a)) + l->radius) * grow * 1.01;
    for (int k = 0; k < 3; k++) x[k] *= length, y[k] *= wide;
    const double pdf = sample_rectangle(d, x, y, e, s, t);
    return pdf > 0 && ilf_luminaire_hit(&hit, l, o, d) ? pdf : 0;
}

double ilf_luminaire_sample(double d[3], const ilf_luminaire *l, const double o[3], double s, double t)
{
    double e[3];
    const double far = away(e, l, o);

    if (l->shape == ILF_RECTANGLE) return sample_rectangle(d, l->a, l->b, e, s, t);
    if (l->shape == ILF_DISC) return sample_disc(d, l, e, s, t);
    if (l->shape == ILF_TUBE) return sample_tube(d, l, o, e, far, s, t);
    return far > l->radius ? sample_sphere(d, l, e, far, s, t) : 0;
}
