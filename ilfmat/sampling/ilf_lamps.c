/*
 * ilf_lamps.c - bright patches that lie together are a lamp, and so are those that were taken out of the field.
 */
#include <stdlib.h>

#include "ilf_sampler.h"
#include "ilf_vec.h"

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
    const double x = ((const ilf_lamp *)a)->excess, y = ((const ilf_lamp *)b)->excess;

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

static void to_world(double p[3], const ilf_frame *fr, double x, double y, double z)
{
    for (int a = 0; a < 3; a++) p[a] = fr->origin[a] + x * fr->u[a] + y * fr->v[a] + z * fr->n[a];
}

static void from_patches(ilf_lamp *lamp, const cluster *c, const ilf_patches *pl)
{
    to_world(lamp->position, &pl->frame, c->sum[0] / c->n, c->sum[1] / c->n, c->sum[2] / c->n);
    lamp->radius = 1.5 * (c->away / c->n + c->ball); /* of a disc, the mean distance is 2/3 of the radius */
    lamp->excess = c->excess * pl->unit;
}

/* A lamp that was taken out of the field; 0 if it is dark. */
static int from_luminaire(ilf_lamp *lamp, const ilf_luminaire *l, const ilf_patches *pl)
{
    const double unit = pl->frame.len_u / pl->field->frame.len_u;

    to_world(lamp->position, &pl->frame, unit * l->centre[0], unit * l->centre[1], unit * l->centre[2]);
    lamp->radius = unit * ilf_luminaire_extent(l);
    lamp->excess = ilf_luminance(l->rgb);
    return lamp->excess > 0;
}

ilf_status ilf_patches_lamps(ilf_lamp *lamps, int *n, int most, const ilf_patches *pl, const double centre[3],
                             double radius, ilf_error *err)
{
    const ilf *f = pl->field;
    cluster *c = malloc(MAX_CLUSTERS * sizeof *c);
    ilf_lamp *all = malloc((size_t)(MAX_CLUSTERS + f->n_lamps) * sizeof *all);
    double own[3];

    if (!c || !all) {
        free(c);
        free(all);
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for its lamps", f->path);
    }
    ilf_lamp_point(own, f, &pl->frame, centre);
    const double unit = pl->frame.len_u / f->frame.len_u;
    const float x[3] = {(float)(unit * own[0]), (float)(unit * own[1]), (float)(unit * own[2])};
    int found = gather_lamps(c, pl, x, (float)radius);
    for (int k = 0; k < found; k++) from_patches(&all[k], &c[k], pl);
    for (int k = 0; k < f->n_lamps; k++) found += from_luminaire(&all[found], &f->lamps[k], pl);
    qsort(all, (size_t)found, sizeof *all, by_excess);
    *n = found < most ? found : most;
    memcpy(lamps, all, (size_t)*n * sizeof *lamps);
    free(c);
    free(all);
    return ILF_OK;
}
