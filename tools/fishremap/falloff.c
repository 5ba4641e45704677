/*
 * falloff.c - falloff curves from files, and their use (falloff.h).
 */
#include "falloff.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/textfile.h"
#include "falloff_json.h"

#define DEG      (M_PI / 180)
#define MAX_ROWS 4096

/* Monotone cubic (Fritsch-Carlson) through n points, evaluated at t; held outside.  As scipy's
 * PchipInterpolator, but flat on the axis; LAPACK has no interpolation. */
static double monotone_cubic(const double *x, const double *y, int n, double t)
{
    if (n == 1 || t <= x[0]) return y[0];
    if (t >= x[n - 1]) return y[n - 1];
    int k = 0;
    while (x[k + 1] < t) k++;
    double m[2];
    for (int j = 0; j < 2; j++) {
        int i = k + j;
        double a = i > 0 ? (y[i] - y[i - 1]) / (x[i] - x[i - 1]) : 0;
        double b = i + 1 < n ? (y[i + 1] - y[i]) / (x[i + 1] - x[i]) : 0;
        if (i == 0) m[j] = x[0] == 0 ? 0 : b; /* a radial function is flat on the axis */
        else if (i == n - 1) m[j] = a;
        else if (a * b <= 0) m[j] = 0;
        else {
            double h0 = x[i] - x[i - 1], h1 = x[i + 1] - x[i], w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;
            m[j] = (w0 + w1) / (w0 / a + w1 / b);
        }
    }
    double h = x[k + 1] - x[k], s = (t - x[k]) / h, d = y[k + 1] - y[k];
    double p = m[0] * h, q = m[1] * h;
    return y[k] + s * (p + s * (3 * d - 2 * p - q + s * (p + q - 2 * d)));
}

static int check(const falloff *f, const char *name, errmsg *e)
{
    for (int c = 0; c < 3; c++)
        for (int k = 0; k <= FALLOFF_STEPS; k++)
            if (!(f->v[c][k] > 1e-3) || !(f->v[c][k] < 1e3))
                return err_set(e,
                               "%s: expected a falloff between 0.001 and 1000 over the whole field, found %g "
                               "at %.4g degrees",
                               name, f->v[c][k], f->half * k / FALLOFF_STEPS / DEG);
    return 0;
}

static void from_polynomial(falloff *f, int channel, const double *c, int n, double unit)
{
    for (int k = 0; k <= FALLOFF_STEPS; k++) {
        double t = f->half * k / FALLOFF_STEPS / unit, v = 0;
        for (int i = n - 1; i >= 0; i--) v = v * t + c[i];
        f->v[channel][k] = v;
    }
}

static int parse_text(falloff *f, const char *text, const char *name, errmsg *e)
{
    double(*rows)[4] = malloc(sizeof(double[4]) * MAX_ROWS);
    int n = 0, npoly = 0, rc = -1;
    if (!rows) return err_set(e, "out of memory");
    textlines lines = textlines_of(text);
    char line[1024];
    while (textlines_next(line, sizeof line, &lines)) {
        double v[FALLOFF_MAX_POWER + 1];
        if (strncmp(line, "polynomial", 10) == 0 && isspace((unsigned char)line[10])) {
            char domain[8];
            int used = 0;
            if (sscanf(line + 10, " %7s%n", domain, &used) != 1) domain[0] = 0;
            double unit = strcmp(domain, "rn") == 0    ? f->half
                          : strcmp(domain, "deg") == 0 ? DEG
                          : strcmp(domain, "rad") == 0 ? 1
                                                       : 0;
            int m = unit > 0 ? text_numbers(v, FALLOFF_MAX_POWER + 1, line + 10 + used) : -1;
            if (m < 1 || npoly == 3) {
                err_set(e,
                        "%s: line %d: expected up to three lines \"polynomial rn|deg|rad c0 c1 ...\", found "
                        "\"%.60s\"",
                        name, lines.number, line);
                goto done;
            }
            from_polynomial(f, npoly++, v, m, unit);
            continue;
        }
        int m = text_numbers(v, FALLOFF_MAX_POWER + 1, line);
        if (m < 4 || n == MAX_ROWS || !(v[0] >= 0) || (n && !(v[0] > rows[n - 1][0] / DEG))) {
            err_set(e, "%s: line %d: expected \"DEGREES R G B\" with growing angles, found \"%.60s\"", name,
                    lines.number, line);
            goto done;
        }
        if (!(v[1] > 0 && v[2] > 0 && v[3] > 0)) {
            err_set(e, "%s: line %d: expected positive values, found \"%.60s\"", name, lines.number, line);
            goto done;
        }
        rows[n][0] = v[0] * DEG;
        memcpy(rows[n] + 1, v + 1, 3 * sizeof(double));
        n++;
    }
    if ((n == 0) == (npoly == 0) || npoly == 2) {
        err_set(e, "%s: expected lines \"DEGREES R G B\", or one or three polynomials, found %d and %d", name,
                n, npoly);
        goto done;
    }
    if (npoly == 1) {
        memcpy(f->v[1], f->v[0], sizeof f->v[0]);
        memcpy(f->v[2], f->v[0], sizeof f->v[0]);
    }
    for (int c = 0; n && c < 3; c++) {
        double *x = malloc(sizeof(double) * 2 * (size_t)n);
        if (!x) {
            err_set(e, "out of memory");
            goto done;
        }
        for (int i = 0; i < n; i++) x[i] = rows[i][0], x[n + i] = rows[i][c + 1];
        for (int k = 0; k <= FALLOFF_STEPS; k++)
            f->v[c][k] = monotone_cubic(x, x + n, n, f->half * k / FALLOFF_STEPS);
        free(x);
    }
    rc = 0;
done:
    free(rows);
    return rc;
}

static int parse_json(falloff *f, const char *text, const char *name, const char *set, double f_number,
                      errmsg *e)
{
    double c[FALLOFF_MAX_POWER + 1];
    if (falloff_json(c, f->chosen, text, name, set, f_number, e)) return -1;
    for (int k = 0; k < 3; k++) from_polynomial(f, k, c, FALLOFF_MAX_POWER + 1, f->half);
    return 0;
}

int falloff_parse(falloff *f, const char *text, const char *name, double half, const char *set,
                  double f_number, errmsg *e)
{
    falloff *t = calloc(1, sizeof *t);
    if (!t) return err_set(e, "out of memory");
    t->half = half;
    const char *p = text;
    while (isspace((unsigned char)*p)) p++;
    int rc = *p == '{' ? parse_json(t, p, name, set, f_number, e) : parse_text(t, text, name, e);
    if (!rc) rc = check(t, name, e);
    if (!rc) *f = *t;
    free(t);
    return rc;
}

int falloff_read(falloff *f, const char *path, double half, const char *set, double f_number, errmsg *e)
{
    char *text;
    if (text_read(&text, path, e)) return -1;
    int rc = falloff_parse(f, text, path, half, set, f_number, e);
    free(text);
    return rc;
}

double falloff_at(const falloff *f, int channel, double theta)
{
    double k = fmin(fmax(theta / f->half, 0), 1) * FALLOFF_STEPS;
    int i = k < FALLOFF_STEPS ? (int)k : FALLOFF_STEPS - 1;
    return f->v[channel][i] + (k - i) * (f->v[channel][i + 1] - f->v[channel][i]);
}

void falloff_apply(float *pix, int channels, const chart *c, const falloff *f)
{
    enum { N = 4096 };
    float gain[3][N + 2];
    int colours = channels >= 3 ? 3 : 1;
    for (int k = 0; k <= N + 1; k++) {
        double t = lens_angle(&c->lens, (double)k / N), g[3];
        for (int i = 0; i < 3; i++) g[i] = 1 / falloff_at(f, i, t);
        for (int i = 0; i < 3; i++)
            gain[i][k] = (float)(colours == 3 ? g[i] : 3 / (1 / g[0] + 1 / g[1] + 1 / g[2]));
    }
#pragma omp parallel for schedule(static)
    for (int y = 0; y < c->height; y++) {
        float *p = pix + (size_t)y * (size_t)c->width * (size_t)channels;
        for (int x = 0; x < c->width; x++, p += channels) {
            double px, py;
            chart_disc_place(&px, &py, c, x + 0.5, y + 0.5);
            double r = fmin(hypot(px, py), 1) * N;
            int i = (int)r;
            float s = (float)(r - i);
            for (int k = 0; k < colours; k++) p[k] *= gain[k][i] + s * (gain[k][i + 1] - gain[k][i]);
        }
    }
}
