/*
 * ilf_lit.c - radiance along a ray of a light field whose lamps were taken out: the residual's, and in front
 * of it the lamps, met analytically (docs/FORMAT.md, section 2.7).
 */
#include <stdlib.h>

#include "ilf_internal.h"
#include "ilf_vec.h"

/* Coordinates beyond this meet no lamp: their squares would overflow. */
#define FARTHEST 1e100

/* A lamp this much behind the auxiliary geometry (relative) is still before it: lamps that are flush with a
 * wall are measured to about that. */
#define FLUSH 0.01

static void to_lamps(double a[3], const ilf *f, const ilf_frame *fr, const double v[3])
{
    const double unit = fr->len_u == f->frame.len_u ? 1 : f->frame.len_u / fr->len_u;

    a[0] = dot(v, fr->u) * unit;
    a[1] = dot(v, fr->v) * unit;
    a[2] = dot(v, fr->n) * unit;
}

void ilf_lamp_point(double p[3], const ilf *f, const ilf_frame *fr, const double x[3])
{
    const double rel[3] = {x[0] - fr->origin[0], x[1] - fr->origin[1], x[2] - fr->origin[2]};

    to_lamps(p, f, fr, rel);
}

/* A lamp that was put out is not there. */
static int is_out(const ilf_luminaire *l)
{
    return l->rgb[0] == 0 && l->rgb[1] == 0 && l->rgb[2] == 0;
}

int ilf_nearest_lamp(const ilf *f, const double o[3], const double d[3], double reach)
{
    int nearest = -1;
    double best = HUGE_VAL, t;

    if (!(fabs(o[0]) < FARTHEST && fabs(o[1]) < FARTHEST && fabs(o[2]) < FARTHEST)) return -1;
    for (int k = 0; k < f->n_lamps; k++) {
        const ilf_luminaire *l = &f->lamps[k];

        if (!ilf_luminaire_hit(&t, l, o, d) || t >= best || is_out(l) || (!l->far && t > (1 + FLUSH) * reach))
            continue;
        best = t;
        nearest = k;
    }
    return nearest;
}

void ilf_add_lamp(float rgb[3], const ilf_luminaire *l, const double o[3], const double d[3])
{
    const double pass = ilf_luminaire_pass(l, o, d), rest = 1 - fmin(pass, 1);

    for (int c = 0; c < 3; c++) rgb[c] = (float)(pass * (double)l->rgb[c] + rest * (double)rgb[c]);
}

/* The ray in the lamps' coordinates: from its own origin where the geometry it met is known, else from where
 * it crosses the plane.  0 if it comes from below. */
static int lamp_ray(double o[3], double d[3], double *reach, const ilf *f, const ilf_frame *fr,
                    const double *origin, const double dir[3], const double *hit, ilf_mode mode)
{
    const double size = fmax(fabs(dir[0]), fmax(fabs(dir[1]), fabs(dir[2])));
    const double less[3] = {dir[0] / size, dir[1] / size, dir[2] / size};
    double h[3];

    to_lamps(d, f, fr, less);
    const double len = sqrt(dot(d, d));
    for (int c = 0; c < 3; c++) d[c] /= len;
    if (!(d[2] > 0)) return 0;
    ilf_lamp_point(h, f, fr, hit ? hit : origin);
    if (hit && origin && mode == ILF_DEPTH) ilf_lamp_point(o, f, fr, origin);
    else
        for (int c = 0; c < 3; c++) o[c] = h[c] - d[c] * (h[2] / d[2]);
    const double to[3] = {h[0] - o[0], h[1] - o[1], h[2] - o[2]};
    *reach = hit ? dot(to, d) : HUGE_VAL;
    return 1;
}

ilf_status ilf_add_lamps(float rgb[3], const ilf *f, const ilf_frame *fr, const double *origin,
                         const double dir[3], const double *hit, ilf_mode mode, ilf_error *err)
{
    double o[3], d[3], reach;

    for (int c = 0; origin && c < 3; c++)
        if (!isfinite(origin[c])) return ilf_fail(err, ILF_ERR_ARG, "ray: expected finite coordinates");
    if (!lamp_ray(o, d, &reach, f, fr, origin, dir, hit, mode)) return ILF_OK;
    const int k = ilf_nearest_lamp(f, o, d, reach);
    if (k >= 0) ilf_add_lamp(rgb, &f->lamps[k], o, d);
    return ILF_OK;
}

/* Edges stored as floats have their ratio to about 1e-7. */
#define EVEN 1e-5

ilf_status ilf_check_frame(const ilf *f, const ilf_frame *fr, ilf_error *err)
{
    const double u = fr->len_u / f->frame.len_u, v = fr->len_v / f->frame.len_v;

    if (f->n_lamps == 0 || fabs(u - v) <= EVEN * fmax(u, v)) return ILF_OK;
    return ilf_fail(
        err, ILF_ERR_ARG,
        "%s: plane: expected edges in the file's proportion, since its lamps keep their shapes; found "
        "%g and %g times as long",
        f->path, u, v);
}

/* A lamp's ball is a little larger than it: what only rounding keeps out must come in. */
#define BALL_MARGIN 1e-6

ilf_status ilf_bound_lamps(ilf *f, ilf_error *err)
{
    if (!(f->lamp_balls = malloc((size_t)(f->n_lamps + 1) * sizeof *f->lamp_balls)))
        return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for %d lamps", f->path, f->n_lamps);
    for (int k = 0; k < f->n_lamps; k++) {
        const ilf_luminaire *l = &f->lamps[k];
        const double r = (1 + BALL_MARGIN) * ilf_luminaire_extent(l);

        memcpy(f->lamp_balls[k], l->centre, sizeof l->centre);
        f->lamp_balls[k][3] = r * r + BALL_MARGIN * BALL_MARGIN * dot(l->centre, l->centre);
    }
    return ILF_OK;
}

/* Does the line through a point pass the ball of any lamp?  Most don't, and this is quick.  1 where overflow
 * or a NaN leaves it open. */
static int passes_lamp(const ilf *f, const ilf_frame *fr, const double from[3], const double dir[3])
{
    const double d[3] = {dot(dir, fr->u), dot(dir, fr->v), dot(dir, fr->n)}, dd = dot(d, d);
    double o[3];
    int near = 0;

    ilf_lamp_point(o, f, fr, from);
    for (int k = 0; k < f->n_lamps; k++) {
        const double *b = f->lamp_balls[k], e[3] = {b[0] - o[0], b[1] - o[1], b[2] - o[2]};
        const double ed = dot(e, d);

        near |= !(dot(e, e) * dd - ed * ed > b[3] * dd);
    }
    return near;
}

ilf_status ilf_eval(float rgb[3], const ilf *f, const ilf_frame *fr, const double origin[3],
                    const double dir[3], const double *hit, ilf_mode mode, ilf_error *err)
{
    const ilf_status st = ilf_eval_residual(rgb, f, fr, origin, dir, hit, mode, err);

    if (st != ILF_OK || f->n_lamps == 0 || !passes_lamp(f, fr, origin ? origin : hit, dir)) return st;
    return ilf_add_lamps(rgb, f, fr, origin, dir, hit, mode, err);
}
