/*
 * lens.c - radial projection models, their derivatives and their inverse (lens.h).
 */
#include "lens.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#define DEG (M_PI / 180)
#define LEAST_STEP                                                                                           \
    (0.999e-9 * DEG) /* of a table: below, slopes leave the range of numbers and no photograph tells */
#define FLATTEST 1e-300
#define STEEPEST 1e300

int lens_kind_by_name(const char *name)
{
    static const char *const names[] = {"equidistant", "equisolid", "stereographic", "orthographic"};
    for (int i = 0; i < 4; i++)
        if (strcmp(name, names[i]) == 0) return i;
    return -1;
}

/* Table: cubic Hermite with the slopes of Fritsch & Carlson (1980), monotone where the data is. */
static double table_radius(double *drdt, const lens *l, double t)
{
    int lo = 0, hi = l->ntable - 1;
    while (hi - lo > 1) {
        int mid = (lo + hi) / 2;
        if (l->tab_t[mid] <= t) lo = mid;
        else hi = mid;
    }
    double h = l->tab_t[hi] - l->tab_t[lo], s = (t - l->tab_t[lo]) / h;
    double r0 = l->tab_r[lo], r1 = l->tab_r[hi], m0 = l->tab_m[lo] * h, m1 = l->tab_m[hi] * h;
    double a = 2 * (r0 - r1) + m0 + m1, b = 3 * (r1 - r0) - 2 * m0 - m1;
    *drdt = (m0 + s * (2 * b + 3 * s * a)) / h;
    return r0 + s * (m0 + s * (b + s * a));
}

static int table_slopes(lens *l, errmsg *e)
{
    int n = l->ntable;
    double d[LENS_MAX_TABLE];
    if (n < 2) return err_set(e, "lens table: expected at least 2 lines, found %d", n);
    for (int i = 0; i + 1 < n; i++) {
        double h = l->tab_t[i + 1] - l->tab_t[i];
        d[i] = (l->tab_r[i + 1] - l->tab_r[i]) / h;
        if (!(h > LEAST_STEP) || !(d[i] > FLATTEST) || !(d[i] < STEEPEST))
            return err_set(
                e, "lens table: expected angle and radius to grow, found %g deg r %g after %g deg r %g",
                l->tab_t[i + 1] / DEG, l->tab_r[i + 1], l->tab_t[i] / DEG, l->tab_r[i]);
    }
    for (int i = 1; i + 1 < n; i++) { /* weighted harmonic mean: never overshoots */
        double h0 = l->tab_t[i] - l->tab_t[i - 1], h1 = l->tab_t[i + 1] - l->tab_t[i];
        double w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;
        l->tab_m[i] = (w0 + w1) / (w0 / d[i - 1] + w1 / d[i]);
    }
    if (n == 2) {
        l->tab_m[0] = l->tab_m[1] = d[0];
        return 0;
    }
    for (int k = 0; k < 2; k++) { /* one-sided three-point slopes, held within (0, 3d] */
        int i0 = k ? n - 1 : 0, s = k ? -1 : 1;
        double h0 = fabs(l->tab_t[i0 + s] - l->tab_t[i0]), h1 = fabs(l->tab_t[i0 + 2 * s] - l->tab_t[i0 + s]);
        double d0 = d[k ? n - 2 : 0], d1 = d[k ? n - 3 : 1];
        double m = ((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
        l->tab_m[i0] = fmin(fmax(m, 0.05 * d0), 3 * d0);
    }
    return 0;
}

/* Sphere: the angle is explicit in the radius. */
static double sphere_angle(double *dtdr, const lens *l, double r)
{
    if (l->distance == 0) {
        *dtdr = 2 / sqrt(fmax(1 - r * r, 1e-24));
        return 2 * asin(fmin(r, 1));
    }
    double tan_rim = 1 / sqrt(l->distance * l->distance - 1);
    double beta = atan(r * tan_rim), s = l->distance * sin(beta);
    double i = asin(fmin(s, 1)), cos_i = sqrt(fmax(1 - s * s, 1e-24));
    *dtdr = (2 * l->distance * cos(beta) / cos_i - 1) * tan_rim * cos(beta) * cos(beta);
    return 2 * i - beta;
}

static double sphere_radius(double *drdt, const lens *l, double t)
{
    if (l->distance == 0) {
        *drdt = cos(t / 2) / 2;
        return sin(t / 2);
    }
    /* In the angle of incidence i the relation theta = 2i - asin(sin(i)/D) is smooth up to the rim. */
    double lo = 0, hi = M_PI / 2, i = fmin((t + 1 / l->distance) / 2, hi);
    for (int k = 0; k < 60; k++) {
        double beta = asin(sin(i) / l->distance), f = 2 * i - beta - t;
        if (f > 0) hi = i;
        else lo = i;
        double next = i - f / (2 - cos(i) / (l->distance * cos(beta)));
        if (!(next > lo && next < hi)) next = (lo + hi) / 2;
        if (fabs(next - i) < 1e-15) break;
        i = next;
    }
    double beta = asin(sin(i) / l->distance), rim = sqrt(l->distance * l->distance - 1);
    double dbdi = cos(i) / (l->distance * cos(beta));
    *drdt = rim / (cos(beta) * cos(beta)) * dbdi / (2 - dbdi);
    return tan(beta) * rim;
}

static double model(double *drdt, const lens *l, double t)
{
    double r = 0, d = 0;
    switch (l->kind) {
    case LENS_EQUIDISTANT: r = t, d = 1; break;
    case LENS_EQUISOLID: r = 2 * sin(t / 2), d = cos(t / 2); break;
    case LENS_STEREOGRAPHIC: r = 2 * tan(t / 2), d = 1 / (cos(t / 2) * cos(t / 2)); break;
    case LENS_ORTHOGRAPHIC: r = sin(t), d = cos(t); break;
    case LENS_POLYNOMIAL:
        for (int k = l->ncoef - 1; k >= 0; k--) {
            d = (d * t) + (k + 1) * l->coef[k];
            r = (r + l->coef[k]) * t;
        }
        break;
    case LENS_TABLE: r = table_radius(&d, l, t); break;
    case LENS_SPHERE: r = sphere_radius(&d, l, t); break;
    }
    *drdt = d;
    return r;
}

/* First angle in (0, half] where a polynomial stops growing, or half if it does not. */
static double end_of_growth(const lens *l, double half)
{
    const int steps = 4096;
    double d, last = 0;
    for (int i = 0; i <= steps; i++) {
        double t = half * i / steps;
        model(&d, l, t);
        if (!(d > 0)) {
            double lo = last, hi = t;
            for (int k = 0; k < 60; k++) {
                double mid = (lo + hi) / 2;
                model(&d, l, mid);
                if (d > 0) lo = mid;
                else hi = mid;
            }
            return lo;
        }
        last = t;
    }
    return half;
}

static const struct {
    double most; /* degrees */
    const char *name;
} reach[] = {[LENS_EQUIDISTANT] = {180, "equidistant"},
             [LENS_EQUISOLID] = {180, "equisolid"},
             [LENS_STEREOGRAPHIC] = {179, "stereographic"},
             [LENS_ORTHOGRAPHIC] = {90, "orthographic"},
             [LENS_POLYNOMIAL] = {180, "polynomial"},
             [LENS_TABLE] = {180, "table"},
             [LENS_SPHERE] = {180, "sphere"}};

void lens_camera(lens *l, double fx, double fy, double cx, double cy, double skew)
{
    l->focal_px = fx;
    l->centre_px[0] = cx + 0.5, l->centre_px[1] = cy + 0.5;
    l->shape[0][0] = 1, l->shape[0][1] = -skew / fx; /* y is up here */
    l->shape[1][0] = 0, l->shape[1][1] = fy / fx;
}

double lens_end(const lens *l)
{
    if (l->kind == LENS_TABLE) return l->ntable ? l->tab_t[l->ntable - 1] : 0;
    double most = reach[l->kind].most * DEG;
    return l->kind == LENS_POLYNOMIAL ? end_of_growth(l, most) : most;
}

int lens_finish(lens *l, double half, errmsg *e)
{
    double d, most = reach[l->kind].most;
    if (!(half > 0) || half > most * DEG * (1 + 1e-12))
        return err_set(e, "%s lens: expected a field of view above 0 and up to %g degrees, found %g",
                       reach[l->kind].name, 2 * most, 2 * half / DEG);
    if (l->kind == LENS_TABLE) {
        if (table_slopes(l, e)) return -1;
        double last = l->tab_t[l->ntable - 1];
        if (l->tab_t[0] != 0 || l->tab_r[0] != 0)
            return err_set(e, "lens table: expected radius 0 at 0 degrees, found %g at %g", l->tab_r[0],
                           l->tab_t[0] / DEG);
        if (half > last * (1 + 1e-9))
            return err_set(
                e,
                "lens table: expected angles up to %g degrees (half the field of view), found none beyond %g",
                half / DEG, last / DEG);
        half = fmin(half, last);
    }
    if (l->kind == LENS_POLYNOMIAL) {
        double end = end_of_growth(l, half);
        if (end < half)
            return err_set(e,
                           "lens polynomial: expected the radius to grow up to %g degrees, found that it "
                           "stops growing at %.4g",
                           half / DEG, end / DEG);
    }
    double r = model(&d, l, half);
    if (!(r > FLATTEST && r < STEEPEST))
        return err_set(e, "lens: expected a positive finite radius at %g degrees, found %g", half / DEG, r);
    l->half = half;
    l->scale = 1 / r;
    return 0;
}

int lens_sphere(lens *l, double distance, errmsg *e)
{
    if (distance != 0 && !(distance > 1 && isfinite(distance)))
        return err_set(e, "expected a camera distance of more than 1 sphere radius, found %g", distance);
    memset(l, 0, sizeof *l);
    l->kind = LENS_SPHERE;
    l->distance = distance;
    l->half = distance == 0 ? M_PI : M_PI - asin(1 / distance);
    l->scale = 1;
    return 0;
}

double lens_radius(double *drdt, const lens *l, double theta)
{
    double d, t = fmin(fmax(theta, 0), l->half), r = l->scale * model(&d, l, t);
    if (drdt) *drdt = l->scale * d;
    return r;
}

double lens_angle(const lens *l, double r)
{
    double d;
    r = fmin(fmax(r, 0), 1);
    switch (l->kind) {
    case LENS_EQUIDISTANT: return r * l->half;
    case LENS_EQUISOLID: return 2 * asin(fmin(r * sin(l->half / 2), 1));
    case LENS_STEREOGRAPHIC: return 2 * atan(r * tan(l->half / 2));
    case LENS_ORTHOGRAPHIC: return asin(fmin(r * sin(l->half), 1));
    case LENS_SPHERE: return fmin(sphere_angle(&d, l, r), l->half);
    default: break;
    }
    /* Newton, kept between bounds: where a step does not halve what is left of the radius (a curve that bends
       sharply can send it to and fro for ever), the bounds are halved instead, so that one of the two shrinks
       each time; at the latest until no number is between them */
    double lo = 0, hi = l->half, t = r * l->half, best = t, least = INFINITY, last = INFINITY;
    for (;;) {
        const double f = lens_radius(&d, l, t) - r, next = t - f / d;
        if (fabs(f) < least) {
            best = t;
            least = fabs(f);
        }
        if (least <= 2 * DBL_EPSILON * r) break;
        if (f > 0) hi = t;
        else lo = t;
        const double middle = (lo + hi) / 2;
        if (!(middle > lo && middle < hi)) break;
        t = next > lo && next < hi && fabs(f) <= last / 2 ? next : middle;
        last = fabs(f);
    }
    return best;
}

double lens_solid_angle(const lens *l, double r)
{
    double d;
    /* the limits at the centre and, where the model has infinite slope, at the rim */
    r = fmin(fmax(r, 1e-7), 1 - 1e-9);
    if (l->kind == LENS_SPHERE) {
        if (l->distance == 0) return 4;
        double t = sphere_angle(&d, l, r);
        return sin(t) * d / r;
    }
    double t = lens_angle(l, r);
    r = lens_radius(&d, l, t);
    return sin(t) / (r * d);
}
