/*
 * ilf_strata.c - directions towards the lamps that were taken out of the field, each a stratum of its own.
 */
#include "ilf_lighting.h"
#include "ilf_vec.h"

/* Where the rays from the point in a direction (lamps' coordinates) begin, as far as lamps are concerned. */
static void lamp_origin(double o[3], const lighting *l, const double d[3])
{
    const double down = l->s->of->mode == ILF_DEPTH ? 0 : l->at_lamps[2] / d[2];

    for (int c = 0; c < 3; c++) o[c] = l->at_lamps[c] - down * d[c];
}

/* Does the direction belong to a lamp rather than to the slice? */
int ilf_meets_lamp(const lighting *l, const double dir[3])
{
    const ilf *f = l->s->of->field;
    const ilf_frame *fr = &l->s->of->frame;
    const double d[3] = {dot(dir, fr->u), dot(dir, fr->v), dot(dir, fr->n)};
    double o[3];

    if (f->n_lamps == 0 || !(d[2] > 0)) return 0;
    lamp_origin(o, l, d);
    return ilf_nearest_lamp(f, o, d, HUGE_VAL) >= 0;
}

/* The golden section: the most even step from part to part. */
#define STEP_U 0.61803398874989485

/* Every second bit of x, from the lowest, as a fraction of 1. */
static double every_second_bit(uint32_t x)
{
    x &= 0x55555555u;
    x = (x | x >> 1) & 0x33333333u;
    x = (x | x >> 2) & 0x0f0f0f0fu;
    x = (x | x >> 4) & 0x00ff00ffu;
    x = (x | x >> 8) & 0x0000ffffu;
    return (x + 0.5) * 0x1p-16;
}

/* The place in the unit square of a number in [0, 1), along Morton's curve. */
static void along_curve(double st[2], double x)
{
    const uint32_t m = (uint32_t)(x * 0x1p32);

    st[0] = every_second_bit(m);
    st[1] = every_second_bit(m >> 1);
}

/* The excess towards a lamp at its candidate: exactly, but for what the residual has behind it.  Above 0
 * wherever the ray that is traced may find some. */
static ilf_status lamp_excess(double *excess, const lighting *l, const ilf_luminaire *lamp, const double o[3],
                              const double d[3], const double dir[3], ilf_error *err)
{
    const double T = l->s->of->threshold, pass = ilf_luminaire_pass(lamp, o, d);

    *excess = pass * fmax(ilf_luminance(lamp->rgb), 0) + fmin(pass, 1) * T;
    if (l->slice->cells == 0) return ILF_OK;
    double behind, t = HUGE_VAL;
    ilf_luminaire_hit(&t, lamp, o, d);
    const double unit = l->s->of->frame.len_u / l->s->of->field->frame.len_u;
    const ilf_status st = ilf_texels_excess(&behind, l, dir, t * unit, err);
    if (st == ILF_OK) *excess += behind + DOUBT * T;
    return st;
}

ilf_status ilf_draw_for_lamp(lighting *l, int k, double u, ilf_error *err)
{
    const ilf_patches *p = l->s->of;
    const ilf_luminaire *lamp = &p->field->lamps[k];
    const int n = ilf_lamp_candidates(l, k), below = p->mode != ILF_DEPTH && lamp->centre[2] < l->at_lamps[2];
    slice_past *past = &l->slice->lamp_past[k];
    const double share = (double)(l->candidates > 0 ? l->candidates : 1) / n,
                 keep = ilf_rays_kept(past, l->at);
    double sum = 0, sum2 = 0;

    for (int i = 0; i < n; i++) {
        candidate *c = &l->mem->c[l->n];
        void *coef = l->mem->coef + (size_t)l->n * l->host->coef_bytes;
        double st[2], o[3], d[3], excess;

        along_curve(st, (i + u) / n);
        u += STEP_U,
            u -= u >= 1; /* elsewhere within each part of the curve, so that a slope's errors cancel */
        const double pdf = ilf_luminaire_sample(d, lamp, l->at_lamps, st[0], st[1]);
        if (!(pdf > 0)) continue;
        for (int a = 0; a < 3 && below; a++)
            d[a] = -d[a]; /* the ray's line goes through it, before the point */
        if (!(d[2] > 0)) continue;
        lamp_origin(o, l, d);
        if (ilf_nearest_lamp(p->field, o, d, HUGE_VAL) != k) continue;
        ilf_to_world(c->dir, &p->frame, d);
        const double f = l->host->lobe(coef, c->dir, l->at->lobes, l->host->context);
        if (!(f > 0)) continue;
        const ilf_status ok = lamp_excess(&excess, l, lamp, o, d, c->dir, err);
        if (ok != ILF_OK) return ok;
        c->target = f * excess;
        if (!(c->target > 0)) continue;
        c->weight = c->target / pdf * share;
        c->past = past;
        c->keep = keep;
        sum += c->weight;
        sum2 += c->weight * c->weight;
        l->n++;
    }
    l->s->work.candidates += n;
    if (!l->at->narrow && !l->at->apart) {
        const double mean = sum / n;
        past->points++;
        past->mean2 += mean * mean;
        past->var += sum2 / n - mean * mean;
    }
    return ILF_OK;
}
