/*
 * ilf_frame.c - the plane of a light field, and the words of errors.
 */
#include <stdarg.h>
#include <stdio.h>

#include "ilf_internal.h"
#include "ilf_vec.h"

ilf_status ilf_fail(ilf_error *err, ilf_status status, const char *fmt, ...)
{
    if (err) {
        va_list ap;

        va_start(ap, fmt);
        vsnprintf(err->text, sizeof err->text, fmt, ap);
        va_end(ap);
        for (char *p = err->text; *p; p++)
            if ((unsigned char)*p < ' ' || *p == 127) *p = '?';
        err->status = status;
    }
    return status;
}

/* Length without overflow or underflow of the squares. */
static double length(const double a[3])
{
    return hypot(hypot(a[0], a[1]), a[2]);
}

/* Unit vector of a; 0 if a has no usable length. */
static double unit(double e[3], const double a[3])
{
    const double len = length(a);

    if (!isfinite(len) || len <= 0) return 0;
    for (int c = 0; c < 3; c++) e[c] = a[c] / len;
    const double len2 = length(e); /* a subnormal length divides inexactly */
    for (int c = 0; c < 3; c++) e[c] /= len2;
    return len;
}

static int finite3(const double a[3])
{
    return isfinite(a[0]) && isfinite(a[1]) && isfinite(a[2]);
}

ilf_status ilf_frame_init(ilf_frame *frame, const double origin[3], const double U[3], const double V[3],
                          const double *normal, ilf_error *err)
{
    ilf_frame f;

    if (!finite3(origin)) return ilf_fail(err, ILF_ERR_ARG, "origin: expected finite numbers");
    f.len_u = unit(f.u, U);
    if (f.len_u <= 0) return ilf_fail(err, ILF_ERR_ARG, "U: expected a finite vector that is not zero");
    f.len_v = unit(f.v, V);
    if (f.len_v <= 0) return ilf_fail(err, ILF_ERR_ARG, "V: expected a finite vector that is not zero");
    const double uv = dot(f.u, f.v);
    if (fabs(uv) > 1e-4)
        return ilf_fail(err, ILF_ERR_ARG, "U, V: expected perpendicular vectors, found U.V = %.3g |U||V|",
                        uv);

    f.cos_uv = uv;

    double n[3];
    cross(n, f.u, f.v);
    unit(f.n, n);
    if (normal) {
        double m[3], x[3];

        if (!finite3(normal) || unit(m, normal) <= 0)
            return ilf_fail(err, ILF_ERR_ARG, "normal: expected a finite vector that is not zero");
        cross(x, m, f.n);
        if (length(x) > 1e-3)
            return ilf_fail(err, ILF_ERR_ARG,
                            "normal: expected +-(U x V), found a vector %.3g degrees off it",
                            asin(fmin(1, length(x))) * (180 / ILF_PI));
        if (dot(m, f.n) < 0)
            for (int c = 0; c < 3; c++) f.n[c] = -f.n[c];
    }
    memcpy(f.origin, origin, sizeof f.origin);
    *frame = f;
    return ILF_OK;
}

int ilf_is_full_sphere(double polar_max)
{
    return fabs(polar_max - ILF_PI) <= 1e-6; /* float's pi is not pi */
}

ilf_status ilf_check_polar(double polar_max, double polar_valid, const char *path, ilf_error *err)
{
    if (!(polar_max > 0 && (polar_max < ILF_PI || ilf_is_full_sphere(polar_max))))
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: ilf:polarMax: expected an angle in (0, pi] radians, found %g", path, polar_max);
    if (!(polar_valid > 0 && isfinite(polar_valid)))
        return ilf_fail(err, ILF_ERR_FORMAT,
                        "%s: ilf:polarValid: expected an angle above 0 radians, found %g", path, polar_valid);
    return ILF_OK;
}

ilf_status ilf_check_plane(ilf_frame *frame, const double origin[3], const double U[3], const double V[3],
                           const char *path, ilf_error *err)
{
    ilf_error words;

    if (ilf_frame_init(frame, origin, U, V, NULL, &words) != ILF_OK)
        return ilf_fail(err, ILF_ERR_FORMAT, "%s: ilf:%s", path, words.text);
    return ILF_OK;
}
