/*
 * ilf_lighting.h - what the parts of ilf_light share: a point being lit, and its candidates.
 */
#ifndef ILF_LIGHTING_H
#define ILF_LIGHTING_H

#include "ilf_sampler.h"

typedef struct candidate {
    double dir[3];
    double target; /* f X: its chance is that over pdf */
    double weight; /* target / pdf; of a lamp's candidate as if it had been one of as many as the slice has */
    slice_past *past; /* of what it is aimed at: a lamp, or the slice */
    double keep;      /* part of its rays that is traced */
    int times, seen;  /* chosen; and found light */
} candidate;

struct ilf_scratch {
    candidate *c;
    unsigned char *coef; /* of each candidate */
    size_t room, coef_bytes;
};

/* All that a point's functions pass on. */
typedef struct lighting {
    ilf_sampler *s;
    const ilf_point *at;
    const ilf_host *host;
    ilf_slice *slice;
    ilf_scratch *mem;
    double at_lamps[3];   /* the point in the lamps' coordinates */
    int candidates, rays; /* to draw from the slice, to trace */
    int n;                /* candidates that count */
    double sum, sum2;     /* of the slice's weights, and of the weights' squares */
} lighting;

/* The point's share of rays, and how many candidates the slice and a lamp get (ilf_numbers.c); the part of a
 * stratum's rays that is traced. */
int ilf_full_rays(const ilf_point *point);
int ilf_slice_candidates(const lighting *l);
int ilf_lamp_candidates(const lighting *l, int lamp);
double ilf_rays_kept(const slice_past *past, const ilf_point *point);

/* Add the slice's candidates (ilf_candidates.c), or a lamp's, u in [0, 1) (ilf_strata.c): l->mem has room. */
ilf_status ilf_draw_from_slice(lighting *l, ilf_error *err);
ilf_status ilf_draw_for_lamp(lighting *l, int lamp, double u, ilf_error *err);

/* Luminance of the texels' excess towards dir, for light that is about `dist` away; nothing is traced. */
ilf_status ilf_texels_excess(double *excess, const lighting *l, const double dir[3], double dist,
                             ilf_error *err);

/* Does the direction belong to a lamp rather than to the slice? */
int ilf_meets_lamp(const lighting *l, const double dir[3]);

/* From the plane's coordinates to the frame's. */
static inline void ilf_to_world(double dir[3], const ilf_frame *fr, const double d[3])
{
    for (int a = 0; a < 3; a++) dir[a] = d[0] * fr->u[a] + d[1] * fr->v[a] + d[2] * fr->n[a];
}

/* Part of the map's own expectation that is added to an estimate of the excess.  More sends rays where nothing
 * is. */
#define DOUBT 0.01

/* The step of an additive recurrence that fills [0, 1) evenly, and with STEP_W's the square: 1/g and 1/g^2,
 * g^3 = g + 1 (M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018). */
#define STEP_V 0.75487766624669276
#define STEP_W 0.56984029099805327

#endif
