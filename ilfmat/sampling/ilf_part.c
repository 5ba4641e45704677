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

ilf_status ilf_eval_part(float rgb[3], const ilf_patches *pl, ilf_part part, const double origin[3],
                         const double dir[3], const double *hit, ilf_error *err)
{
    float all[3];
    const ilf_status st = ilf_eval(all, pl->field, &pl->frame, origin, dir, hit, pl->mode, err);

    if (st != ILF_OK) return st;
    const double part_of = part == ILF_ALL ? 1 : share(all, pl->threshold, part);
    for (int c = 0; c < 3; c++) rgb[c] = (float)((double)all[c] * part_of);
    return ILF_OK;
}
