/*
 * model.c - hypotheses of what hides or shapes a lamp, and how they are judged.
 */
#include "model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

double model_row(const row *r, const lamp *l, const lightfield *f, const ilf_mask *masks, int n)
{
    ilf_luminaire body = l->s.l;
    double sum = 0;

    body.nmasks = n, body.masks = (ilf_mask *)masks;
    for (int k = 0; k < r->n; k++) sum += ilf_luminaire_pass(&body, f->pos[r->probe], r->dir[k]);
    return sum / r->n;
}

void model_judge(model *m, const lamp *l, const lightfield *f)
{
    double sum = 0, weight = 0;

    for (int k = 0; k < l->nrows; k++) {
        const row *r = &l->rows[k];
        const double miss = model_row(r, l, f, m->m[fold_of(f, r->probe)], m->n) - r->value;
        sum += r->share * miss * miss, weight += r->share;
    }
    m->error = weight > 0 ? sqrt(sum / weight) : 0;
}

enum { ACROSS = 15 };
static const double LEVEL[PLACES / ACROSS / ACROSS] = {.02, .1, .3}; /* sizes of the plane */

int model_place(double o[3], int k, const lamp *l, const lightfield *f)
{
    o[0] = f->len_u * (k % ACROSS + .5) / ACROSS, o[1] = f->len_v * (k / ACROSS % ACROSS + .5) / ACROSS;
    o[2] = f->size * LEVEL[k / ACROSS / ACROSS];
    return o[2] < l->s.l.centre[2] - ilf_luminaire_extent(&l->s.l);
}

void model_line(double d[3], const double o[3], int point, const lamp *l)
{
    const double r = .6 * ilf_luminaire_extent(&l->s.l);

    v_sub(d, l->s.l.centre, o);
    if (point) d[0] += point & 1 ? r : -r, d[1] += point & 2 ? r : -r;
    v_unit(d);
}

/* Sum of squares of what the folds' versions differ by along lines from one place to the lamp. */
static double parting(const model *m, const lamp *l, const double o[3])
{
    ilf_luminaire body = l->s.l;
    double sum = 0;

    body.nmasks = m->n;
    for (int q = 0; q < LAMP_POINTS; q++) {
        double d[3], v[FOLDS + 1];
        model_line(d, o, q, l);
        for (int s = 0; s <= FOLDS; s++) {
            body.masks = (ilf_mask *)m->m[s];
            v[s] = ilf_luminaire_pass(&body, o, d);
        }
        for (int s = 0; s < FOLDS; s++) sum += (v[s] - v[ALL]) * (v[s] - v[ALL]) / LAMP_POINTS;
    }
    return sum;
}

double model_spread(const model *m, const lamp *l, const lightfield *f)
{
    double sum = 0, o[3];

    for (int k = 0; k < PLACES; k++)
        if (model_place(o, k, l, f)) sum += parting(m, l, o);
    return sqrt(sum * (FOLDS - 1) / FOLDS / PLACES);
}

int model_copy(model *to, const model *from)
{
    *to = *from;
    for (int k = 0; k <= FOLDS; k++)
        for (int i = 0; i < from->n; i++) {
            const ilf_mask *m = &from->m[k][i];
            const size_t bytes = mask_bytes(m);
            to->m[k][i].grid = m->grid ? malloc(bytes) : NULL;
            if (!m->grid) continue;
            if (!to->m[k][i].grid) return -1;
            memcpy(to->m[k][i].grid, m->grid, bytes);
        }
    return 0;
}

void model_free(model *m)
{
    for (int k = 0; k <= FOLDS; k++)
        for (int i = 0; i < MODEL_MASKS; i++) free(m->m[k][i].grid);
    memset(m, 0, sizeof *m);
}

size_t mask_bytes(const ilf_mask *m)
{
    return (size_t)m->nx * (size_t)m->ny * (size_t)(m->nz > 0 ? m->nz : 1) * sizeof *m->grid;
}

int mask_grid(ilf_mask *m, int nx, int ny, double x0, double y0, double x1, double y1)
{
    m->nx = nx, m->ny = ny, m->x0 = x0, m->y0 = y0;
    m->dx = nx > 1 ? (x1 - x0) / (nx - 1) : 1, m->dy = ny > 1 ? (y1 - y0) / (ny - 1) : 1;
    m->grid = calloc((size_t)nx * (size_t)ny, sizeof *m->grid);
    return m->grid ? 0 : -1;
}
