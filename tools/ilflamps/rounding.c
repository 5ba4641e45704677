/*
 * rounding.c - see rounding.h.
 */
#include "rounding.h"

#include "base/cli.h"

const char *rounding_compression(double tolerance, int interleave)
{
    return tolerance > 0 && !interleave ? "zip" : "none";
}

void rounding_say(const ilf_loss *l, const char *path, int lamps)
{
    cli_note("%s: texels rounded, by %.2g %% at most; irradiance at the nodes%s by %.2g %% (rms), at worst "
             "%+.2g %% "
             "(probe (%d,%d)), all together %+.1g %%",
             path, 100 * l->texel, lamps ? ", from what is left in the probes," : "", 100 * l->rms,
             100 * l->worst, l->worst_i, l->worst_j, 100 * l->mean);
}
