/*
 * ilf_candidates.c - directions from the slice of what is bright, and what the texels show there.
 */
#include "ilf_lighting.h"

/* Luminance of the texels' excess towards dir, for light that is about `dist` away; nothing is traced. */
ilf_status ilf_texels_excess(double *excess, const lighting *l, const double dir[3], double dist,
                             ilf_error *err)
{
    const ilf_patches *p = l->s->of;
    const double *x = l->at->position;
    const int near = p->mode == ILF_DEPTH && isfinite(dist);
    const double hit[3] = {x[0] + (near ? dist * dir[0] : 0), x[1] + (near ? dist * dir[1] : 0),
                           x[2] + (near ? dist * dir[2] : 0)};
    float rgb[3];
    const ilf_status st =
        ilf_eval_residual(rgb, p->field, &p->frame, NULL, dir, hit, near ? ILF_DEPTH : ILF_NO_DEPTH, err);

    if (st == ILF_OK) *excess = ilf_luminance(rgb) * ilf_excess_part(rgb, p->threshold);
    return st;
}

/* How far the auxiliary geometry is.  A map that expects nothing in a direction knows no distance, and a
 * wrong one shows lamps where there are none: one such candidate in a thousand outweighs all true ones. */
static double distance_to(const lighting *l, const double dir[3])
{
    const double *x = l->at->position;
    double hit[3];

    if (!l->host->hit || !l->host->hit(hit, x, dir, l->host->context)) return HUGE_VAL;
    const double d[3] = {hit[0] - x[0], hit[1] - x[1], hit[2] - x[2]};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* An estimate of the excess towards a candidate: above 0 wherever there may be some. */
static ilf_status estimate(double *excess, const lighting *l, const double dir[3], ilf_draw *dr,
                           ilf_error *err)
{
    const int depth = l->s->of->mode == ILF_DEPTH;
    double x;
    ilf_status st = ilf_texels_excess(excess, l, dir, dr->far, err);

    if (st != ILF_OK || !depth) return st;
    if (!isfinite(dr->far) && *excess > 0) {
        dr->near = dr->far = distance_to(l, dir);
        st = ilf_texels_excess(excess, l, dir, dr->far, err);
    }
    if (st == ILF_OK && dr->near < ONE_DISTANCE * dr->far) {
        st = ilf_texels_excess(&x, l, dir, dr->near, err);
        if (st == ILF_OK && x > *excess) *excess = x;
    }
    *excess += DOUBT * (dr->expected + l->s->of->threshold);
    return st;
}

ilf_status ilf_draw_from_slice(lighting *l, ilf_error *err)
{
    const ilf_host *h = l->host;
    const double u = h->random(ILF_ALONG_MAP, h->context);
    double v = h->random(ILF_IN_CELL_U, h->context), w = h->random(ILF_IN_CELL_V, h->context);
    const double keep = ilf_rays_kept(&l->slice->past, l->at);

    for (int k = 0; k < l->candidates; k++) {
        candidate *c = &l->mem->c[l->n];
        void *coef = l->mem->coef + (size_t)l->n * h->coef_bytes;
        ilf_draw dr;

        v += STEP_V, v -= v >= 1;
        w += STEP_W, w -= w >= 1;
        ilf_sample(&dr, l->slice, (k + u) / l->candidates, v, w);
        ilf_to_world(c->dir, &l->s->of->frame, dr.dir);
        const double f = h->lobe(coef, c->dir, l->at->lobes, h->context);
        double excess;
        if (!(f > 0) || ilf_meets_lamp(l, c->dir)) continue;
        const ilf_status st = estimate(&excess, l, c->dir, &dr, err);
        if (st != ILF_OK) return st;
        c->target = f * excess;
        if (!(c->target > 0)) continue;
        c->weight = c->target / dr.pdf;
        c->past = &l->slice->past;
        c->keep = keep;
        l->sum += c->weight;
        l->sum2 += c->weight * c->weight;
        l->n++;
    }
    l->s->work.candidates += l->candidates;
    return ILF_OK;
}
