/*
 * ocam.c - OCamCalib's calib_results.txt (calibration.h; D. Scaramuzza, OCamCalib toolbox, cam2world.m and
 * get_ocam_model.m).
 *
 * A pixel (row, column) is  (row - xc, column - yc) = [c d; e 1] (x, y),  rho = |(x, y)|, and shows the
 * direction (x, y, f(rho)) with f the polynomial of the "direct mapping function", negative about the axis:
 * the angle from the axis is atan2(rho, -f(rho)). x runs down and y to the right, so in our (right, up) = (y,
 * -x):
 *
 *      right offset = y + e x         = (1, -e) . (y, -x)
 *      up offset    = -(c x + d y)    = (-d, c) . (y, -x)
 */
#include <math.h>
#include <string.h>

#include "base/textfile.h"
#include "calibration.h"

#define STEPS 8192

int calibration_is_ocam(const char *text)
{
    return strstr(text, "DIRECT mapping function") != NULL || strstr(text, "ocam_model.ss") != NULL;
}

static double angle_at(const double *c, int n, double rho)
{
    double f = 0;
    for (int k = n - 1; k >= 0; k--) f = f * rho + c[k];
    return atan2(rho, -f);
}

/* r(theta) in pixels, as far as the angle grows with the radius. */
static int fill_table(lens *l, const double *c, int n, double far, const char *name, errmsg *e)
{
    double end = 0, last = 0;
    for (int i = 1; i <= STEPS; i++) {
        double t = angle_at(c, n, far * i / STEPS);
        if (!(t > last) || t > M_PI * (1 - 1e-9)) break;
        last = t, end = far * i / STEPS;
    }
    if (!(last > 0.01))
        return err_set(e, "%s: expected a mapping function whose angle grows with the radius, found none",
                       name);
    l->kind = LENS_TABLE;
    l->ntable = LENS_MAX_TABLE;
    for (int i = 0; i < LENS_MAX_TABLE; i++) {
        l->tab_r[i] = end * i / (LENS_MAX_TABLE - 1);
        l->tab_t[i] = i ? angle_at(c, n, l->tab_r[i]) : 0;
    }
    return 0;
}

int calibration_ocam(lens *l, const char *text, const char *name, errmsg *e)
{
    static const char *const what[] = {"the mapping function", "its inverse", "the centre's row and column",
                                       "the affine c, d, e", "the picture's height and width"};
    static const int least[] = {3, 2, 2, 3, 2}, most[] = {31, 63, 2, 3, 2};
    double v[5][64];
    int n[5] = {0}, k = 0;
    char line[4096];
    textlines t = textlines_of(text);
    while (k < 5 && textlines_next(line, sizeof line, &t)) {
        n[k] = text_numbers(v[k], 64, line);
        int counted = k < 2; /* polynomials begin with the number of their coefficients */
        if (n[k] < least[k] + counted || n[k] > most[k] + counted || (counted && v[k][0] != n[k] - 1))
            return err_set(e, "%s: line %d: expected %s, found \"%.60s\"", name, t.number, what[k], line);
        k++;
    }
    if (k < 5)
        return err_set(e, "%s: expected OCamCalib's five lines of numbers, found %d (%s is missing)", name, k,
                       what[k]);
    const double *a = v[3], w = v[4][1], h = v[4][0];
    if (!(v[0][1] < 0))
        return err_set(e, "%s: expected a mapping function that is negative on the axis, found %g", name,
                       v[0][1]);
    if (!(a[0] - a[1] * a[2] > 0.1) || !(a[0] < 10))
        return err_set(e, "%s: expected affine c, d, e near 1, 0, 0, found %g, %g, %g", name, a[0], a[1],
                       a[2]);
    if (!(w >= 1 && h >= 1 && w < 1e6 && h < 1e6))
        return err_set(e, "%s: expected the picture's height and width, found %g and %g", name, h, w);
    l->centre_px[0] = v[2][1] + 0.5, l->centre_px[1] = v[2][0] + 0.5;
    l->focal_px = 1;
    l->size_px[0] = w, l->size_px[1] = h;
    l->shape[0][0] = 1, l->shape[0][1] = -a[2];
    l->shape[1][0] = -a[1], l->shape[1][1] = a[0];
    return fill_table(l, v[0] + 1, n[0] - 1, 2 * hypot(w, h), name, e);
}
