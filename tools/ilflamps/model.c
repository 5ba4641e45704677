/*
 * model.c - hypotheses of what hides or shapes a lamp, and how they are judged.
 */
#include "model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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
