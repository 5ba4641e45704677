/*
 * align.c - see align.h.
 */
#include "align.h"

#include <math.h>
#include <stdlib.h>

enum { LEVELS = 5 };
static const double gamma_seen = 2.2; /* grey values are light to the power 1/this */
static const float cut = 250;         /* grey value from which on both pictures are flat */
static const double least_sd = 0.2;   /* grey values: what varies less shows nothing */
static const double least_corr = 0.3; /* correlation of two pictures of one scene, when registered */
static const double least_gain =
    0.5; /* of the correlation that the motion should win back, see believable() */
static const double share_per_pixel = 0.01, most_share = 0.25; /* of 1 - correlation that it should win */
static const double doubt_reach = 0.5;  /* pixels: a motion up to here that is not believed is none */
static const double like = 0.9;         /* correlation from which on a shot lies well enough as it is */
static const double least_reach = 0.15; /* pixels: less is not worth an interpolation */

double align_reach(const motion *m, int w, int h)
{
    double most = 0;
    for (int corner = 0; corner < 4; corner++) {
        double x = corner & 1 ? w - 1 : 0, y = corner & 2 ? h - 1 : 0, mx, my;
        motion_apply(m, x, y, &mx, &my);
        most = fmax(most, hypot(mx - x, my - y));
    }
    return most;
}

/* grey * gain, cut off; standard deviation of what is seen */
static double brought(float *to, const align_picture *p, double gain, size_t pixels)
{
    double sum = 0, sum2 = 0, n = 0;
    for (size_t i = 0; i < pixels; i++) {
        float v = (float)((double)p->grey[i] * gain);
        to[i] = v < cut ? v : cut;
        if (p->seen && !p->seen[i]) continue;
        n++;
        sum += (double)to[i];
        sum2 += (double)to[i] * (double)to[i];
    }
    return n > 1 ? sqrt(fmax(0, sum2 / n - sum / n * (sum / n))) : 0;
}

/* A real motion wins back what displacing the picture against itself would lose, and the more it moves, the
 * more of what was unexplained; one that fits noise, or the few pixels that are not clipped, wins much less.
 */
static int believable(const motion_found *f, double reach)
{
    double won = f->after - f->before, share = fmin(most_share, share_per_pixel * reach);
    return f->after >= least_corr && won >= least_gain * f->after * (1 - f->self) &&
           won >= share * (1 - f->before);
}

/* The step from shot `rest` to `moved`, further from the middle. */
static int step(align_shot *out, const align_picture *pictures, const double *exposure, int rest, int moved,
                int w, int h, float *room, errmsg *e)
{
    size_t pixels = (size_t)w * (size_t)h;
    double ratio = exposure[rest] / exposure[moved], gain = pow(fmax(ratio, 1 / ratio), 1 / gamma_seen);
    double sd_rest = brought(room, &pictures[rest], ratio < 1 ? gain : 1, pixels);
    double sd_moved = brought(room + pixels, &pictures[moved], ratio > 1 ? gain : 1, pixels);
    motion_found found = {{0, 0, 0}, 0, 0, 1};
    if (sd_rest >= least_sd && sd_moved >= least_sd &&
        vision_motion(&found, room, room + pixels, pictures[rest].seen, pictures[moved].seen, w, h, LEVELS,
                      e))
        return -1;
    align_shot *s = &out[moved];
    double reach = align_reach(&found.m, w, h);
    int moved_so = believable(&found, reach);
    s->registered = moved_so || (found.after >= least_corr && reach <= doubt_reach) || found.before >= like;
    s->before = found.before;
    s->after = moved_so ? found.after : found.before;
    s->m = moved_so ? motion_chain(out[rest].m, found.m) : out[rest].m;
    return 0;
}

int align_estimate(align_shot *out, const align_picture *pictures, const double *exposure, int n, int w,
                   int h, errmsg *e)
{
    int middle = n / 2, bad = 0;
    float *room = malloc(2 * (size_t)w * (size_t)h * sizeof *room);
    if (!room) return err_set(e, "aligning: out of memory for %dx%d pixels", w, h);
    out[middle] = (align_shot){.before = 1, .after = 1, .registered = 1};
    /* a shot of something else must not cut the chain: the next one is held against the last that was
     * registered */
    for (int k = middle - 1, rest = middle; k >= 0 && !bad; rest = out[k].registered ? k : rest, k--)
        bad = step(out, pictures, exposure, rest, k, w, h, room, e);
    for (int k = middle + 1, rest = middle; k < n && !bad; rest = out[k].registered ? k : rest, k++)
        bad = step(out, pictures, exposure, rest, k, w, h, room, e);
    free(room);
    for (int k = 0; k < n && !bad; k++) out[k].moves = align_reach(&out[k].m, w, h) >= least_reach;
    return bad;
}
