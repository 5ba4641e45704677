/*
 * ilf_lamps.c - bright patches that lie together are a lamp.
 */
#include <stdlib.h>

#include "ilf_sampler.h"

/* A lamp being gathered: patches within a few degrees of its first one, as seen from x. */
typedef struct cluster {
    float dir[3];      /* towards the first patch */
    double sum[3], n;  /* mean position */
    double away, ball; /* sum of distances from it; smallest patch's ball */
    double excess;
    int whole; /* made of whole patches */
} cluster;

enum { MAX_CLUSTERS = 64 };
#define CLUSTER_COS 0.9962f /* 5 degrees */

static int by_excess(const void *a, const void *b)
{
    const double x = ((const cluster *)a)->excess, y = ((const cluster *)b)->excess;

    return (x < y) - (x > y);
}

/* Gather the patches that the ball sees into c: whole ones first, parts (half of which are not the lamp) only
 * where there are no others; then again, so that distances are from the means. */
static int gather_lamps(cluster *c, const ilf_patches *pl, const float x[3], float r)
{
    int n = 0;

    for (int round = 0; round < 3; round++)
        for (size_t k = 0; k < pl->n; k++) {
            const patch *p = &pl->p[k];
            const float d[3] = {p->u - x[0], p->v - x[1], p->n - x[2]};
            const float len = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            int m = 0;

            if (round < 2 && p->whole != (round == 0)) continue;
            if (ilf_patch_weight(pl, p, x, r) <= 0 || len <= 0) continue;
            while (m < n &&
                   (d[0] * c[m].dir[0] + d[1] * c[m].dir[1] + d[2] * c[m].dir[2]) < CLUSTER_COS * len)
                m++;
            if (m < n && p->whole != c[m].whole) continue;
            if (round < 2) {
                if (m == MAX_CLUSTERS) continue;
                if (m == n) {
                    memset(&c[n], 0, sizeof c[n]);
                    for (int a = 0; a < 3; a++) c[n].dir[a] = d[a] / len;
                    c[n].whole = p->whole;
                    n++;
                }
                c[m].sum[0] += (double)p->u, c[m].sum[1] += (double)p->v, c[m].sum[2] += (double)p->n;
                c[m].n++;
                c[m].excess = fmax(c[m].excess, (double)p->excess);
            } else if (m < n) {
                const double a = (double)p->u - c[m].sum[0] / c[m].n, b = (double)p->v - c[m].sum[1] / c[m].n,
                             e = (double)p->n - c[m].sum[2] / c[m].n;
                c[m].away += sqrt(a * a + b * b + e * e);
                c[m].ball = c[m].ball > 0 ? fmin(c[m].ball, (double)p->radius) : (double)p->radius;
            }
        }
    return n;
}

ilf_status ilf_patches_lamps(ilf_lamp *lamps, int *n, int most, const ilf_patches *pl, const double centre[3],
                             double radius, ilf_error *err)
{
    const ilf_frame *fr = &pl->frame;
    cluster *c = malloc(MAX_CLUSTERS * sizeof *c);
    float x[3];

    if (!c) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for its lamps", pl->field->path);
    for (int a = 0; a < 3; a++) {
        const double *axis = a == 0 ? fr->u : a == 1 ? fr->v : fr->n;
        x[a] = (float)((centre[0] - fr->origin[0]) * axis[0] + (centre[1] - fr->origin[1]) * axis[1] +
                       (centre[2] - fr->origin[2]) * axis[2]);
    }
    const int found = gather_lamps(c, pl, x, (float)radius);
    qsort(c, (size_t)found, sizeof *c, by_excess);
    *n = found < most ? found : most;
    for (int k = 0; k < *n; k++) {
        for (int a = 0; a < 3; a++)
            lamps[k].position[a] =
                fr->origin[a] +
                (c[k].sum[0] * fr->u[a] + c[k].sum[1] * fr->v[a] + c[k].sum[2] * fr->n[a]) / c[k].n;
        lamps[k].radius =
            1.5 * (c[k].away / c[k].n + c[k].ball); /* of a disc, the mean distance is 2/3 of the radius */
        lamps[k].excess = c[k].excess * pl->unit;
    }
    free(c);
    return ILF_OK;
}
