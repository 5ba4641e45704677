/*
 * ilf_part.c - what a ray that meets the light field counts of it.
 *
 * A light field's radiance is the sum of base and excess.  ilf_light brings the excess to the points that it
 * is asked for; so rays that these points scatter count the base alone, and rays that ilf_light traces the
 * excess alone. Of light that comes by way of a mirror nobody samples the excess, but where a cone around a
 * glint does.
 */
#include "ilf_sampler.h"

ilf_part ilf_ray_part(const ilf_way *way)
{
    if (way->aimed) return way->aimed > 0 ? ILF_EXCESS : ILF_NONE;
    if (way->scattered || way->in_glint) return ILF_BASE;
    return ILF_ALL;
}

/* How much of a radiance a part is. */
static double share(const float rgb[3], double threshold, ilf_part part)
{
    const double excess = ilf_excess_part(rgb, threshold);

    return (part & ILF_EXCESS ? excess : 0) + (part & ILF_BASE ? 1 - excess : 0);
}

/* Of a field whose lamps were taken out the base is the residual's, and all else is excess. */
static ilf_status lit_part(float rgb[3], const ilf_patches *pl, ilf_part part, const double origin[3],
                           const double dir[3], const double *hit, ilf_error *err)
{
    float left[3], all[3];
    ilf_status st = ilf_eval_residual(left, pl->field, &pl->frame, origin, dir, hit, pl->mode, err);

    memcpy(all, left, sizeof all);
    if (st == ILF_OK && part != ILF_BASE)
        st = ilf_add_lamps(all, pl->field, &pl->frame, origin, dir, hit, pl->mode, err);
    if (st != ILF_OK) return st;
    const double base = 1 - ilf_excess_part(left, pl->threshold);
    for (int c = 0; c < 3; c++)
        rgb[c] = part == ILF_BASE     ? (float)(base * (double)left[c])
                 : part == ILF_EXCESS ? (float)((double)all[c] - base * (double)left[c])
                                      : all[c];
    return ILF_OK;
}

ilf_status ilf_eval_part(float rgb[3], const ilf_patches *pl, ilf_part part, const double origin[3],
                         const double dir[3], const double *hit, ilf_error *err)
{
    float all[3];

    if (pl->field->n_lamps && part != ILF_NONE) return lit_part(rgb, pl, part, origin, dir, hit, err);
    const ilf_status st = ilf_eval(all, pl->field, &pl->frame, origin, dir, hit, pl->mode, err);

    if (st != ILF_OK) return st;
    const double part_of = part == ILF_ALL ? 1 : share(all, pl->threshold, part);
    for (int c = 0; c < 3; c++) rgb[c] = (float)((double)all[c] * part_of);
    return ILF_OK;
}
