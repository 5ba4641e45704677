/*
 * noise.c - the noise model and its fit; see noise.h.
 */
#include "noise.h"

#include <math.h>
#include <stdlib.h>

#include "qrls.h"

static const double rounding_var = 1.0 / 12;

noise_model noise_default(void)
{
    noise_model m = {1.0 / 20000, 10.0 / 20000, rounding_var};
    return m;
}

noise_model noise_from_camera(double gain, double read_electrons, int max_code)
{
    double full = gain * max_code;
    noise_model m = {1 / full, read_electrons / full, rounding_var};
    return m;
}

double noise_variance(const noise_model *m, double e, double slope)
{
    return m->photon * fmax(e, 0) + m->read * m->read + m->code_var * slope * slope;
}

/* Relative variance is linear in p = (photon, read^2, code_var - 1/12). */
static void cell_terms(const noise_cell *c, double t[3])
{
    t[0] = 1 / c->e;
    t[1] = 1 / (c->e * c->e);
    t[2] = c->slope * c->slope / (c->e * c->e);
}

static double modelled(const double p[3], const noise_cell *c)
{
    double t[3];
    cell_terms(c, t);
    return p[0] * t[0] + p[1] * t[1] + (p[2] + rounding_var) * t[2];
}

/* Best p over one active set with weights n / (2 variance^2), the sampling variance of a variance.  Its cost;
 * INFINITY: no such p; NAN: out of memory. */
static double solve_set(double p[3], int set, const noise_cell *cells, int n, const double prev[3],
                        const double held[3])
{
    int column[3], cols = 0;
    for (int k = 0; k < 3; k++) column[k] = (set >> k & 1) && held[k] < 0 ? cols++ : -1;
    for (int k = 0; k < 3; k++) p[k] = held[k] >= 0 ? held[k] : 0;
    qrls *q = cols ? qrls_new(cols) : NULL;
    if (cols && !q) return NAN;
    double scale[3];
    for (int k = 0; k < 3; k++) {
        double biggest = 0, t[3];
        for (int i = 0; i < n; i++) {
            cell_terms(&cells[i], t);
            biggest = fmax(biggest, t[k] / modelled(prev, &cells[i]));
        }
        scale[k] = biggest > 0 ? 1 / biggest : 1;
    }
    for (int i = 0; i < n && cols; i++) {
        double t[3], w = sqrt(cells[i].n / 2) / modelled(prev, &cells[i]);
        cell_terms(&cells[i], t);
        double *row = qrls_row(q), rest = cells[i].relative_square - modelled(p, &cells[i]);
        if (!row) {
            qrls_free(q);
            return NAN;
        }
        for (int k = 0; k < 3; k++)
            if (column[k] >= 0) row[column[k]] = w * t[k] * scale[k];
        row[cols] = w * rest;
    }
    if (cols) {
        double x[3] = {0};
        int bad = qrls_solve(q, x, 1e-10, NULL, NULL);
        qrls_free(q);
        if (bad) return bad == -2 ? NAN : INFINITY;
        for (int k = 0; k < 3; k++)
            if (column[k] >= 0) {
                p[k] = x[column[k]] * scale[k];
                if (p[k] < 0) return INFINITY;
            }
    }
    double cost = 0;
    for (int i = 0; i < n; i++) {
        double d = (cells[i].relative_square - modelled(p, &cells[i])) / modelled(prev, &cells[i]);
        cost += cells[i].n / 2 * d * d;
    }
    return cost;
}

int noise_fit(noise_model *m, const noise_cell *cells, int n, const noise_model *fixed)
{
    double held[3] = {-1, -1, -1};
    if (fixed) {
        held[0] = fixed->photon;
        held[1] = fixed->read < 0 ? -1 : fixed->read * fixed->read;
        held[2] = fixed->code_var < 0 ? -1 : fmax(fixed->code_var - rounding_var, 0);
    }
    if (n < 3) return -1;
    double best[3] = {m->photon, m->read * m->read, fmax(m->code_var - rounding_var, 0)};
    for (int pass = 0; pass < 4; pass++) { /* the weights come from the previous pass's variances */
        double prev[3] = {best[0], best[1], best[2]}, least = INFINITY;
        for (int set = 0; set < 8; set++) {
            double p[3];
            double cost = solve_set(p, set, cells, n, prev, held);
            if (isnan(cost)) return -2;
            if (cost < least) {
                least = cost;
                for (int k = 0; k < 3; k++) best[k] = p[k];
            }
        }
        if (!isfinite(least)) return -1;
    }
    m->photon = best[0];
    m->read = sqrt(best[1]);
    m->code_var = best[2] + rounding_var;
    return 0;
}
