/*
 * jobflare.c - the stage that takes out what the lens has scattered (flare.h): a smaller copy of the merged
 * picture is judged, and the picture made (I - veil) / (1 - v) where flare is certain.
 *
 * Whether there is any is asked once, of all channels together; how much and how wide, of each.  Nothing is
 * changed where it is not certain.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "job.h"

static const double small_pixels = 3e5; /* of the copy, at most about so many */
static const double beyond_rim = 1.03;  /* of the circle's radius: from here on no light of the scene falls */
static const double mostly = 0.5;       /* of a copy's pixel that are bounds: it is one */

typedef struct copy {
    int width, height, factor, channels;
    float *light, *veil;                /* [channels + 1][height][width], the last: the channels' mean */
    unsigned char *kind, *dark, *group; /* [height][width] */
} copy;

static void copy_free(copy *c)
{
    free(c->light);
    free(c->veil);
    free(c->kind);
}

static size_t copy_pixels(const copy *c)
{
    return (size_t)c->width * (size_t)c->height;
}

static flare_picture picture_of(const copy *c, int channel)
{
    return (flare_picture){c->width, c->height, c->light + (size_t)channel * copy_pixels(c), c->kind,
                           c->dark};
}

/* Mean over a block's pixels that are not missing. */
static void copy_pixel(copy *c, const job *j, int x, int y)
{
    const img_info *im = &j->radiance.info;
    int f = c->factor, ch = c->channels, n = 0, bounds = 0;
    double sum[3] = {0}, all = 0;
    for (int v = y * f; v < (y + 1) * f; v++)
        for (int u = x * f; u < (x + 1) * f; u++) {
            size_t i = (size_t)v * (size_t)im->width + (size_t)u;
            if (j->flags[i] & MERGE_MISSING) continue;
            n++;
            bounds += (j->flags[i] & (MERGE_BLACK | MERGE_GAP)) != 0;
            for (int k = 0; k < ch; k++)
                sum[k] += fmax((double)j->radiance.pix[i * (size_t)ch + (size_t)k], 0);
        }
    size_t at = (size_t)y * (size_t)c->width + (size_t)x, pixels = copy_pixels(c);
    for (int k = 0; k < ch; k++) {
        double mean = n ? sum[k] / n : 0;
        c->light[(size_t)k * pixels + at] = (float)mean;
        all += mean / ch;
    }
    c->light[(size_t)ch * pixels + at] = (float)all;
    c->kind[at] = n == 0 ? FLARE_NOTHING : bounds > mostly * n ? FLARE_BOUND : FLARE_SEEN;
    c->dark[at] = !job_in_circle(j, (x + 0.5) * f, (y + 0.5) * f, beyond_rim);
}

static int copy_init(copy *c, const job *j, errmsg *e)
{
    const img_info *im = &j->radiance.info;
    int least = im->width < im->height ? im->width : im->height;
    *c = (copy){.channels = im->channels};
    c->factor = (int)ceil(sqrt((double)im->width * im->height / small_pixels));
    if (c->factor > least) c->factor = least;
    c->width = im->width / c->factor;
    c->height = im->height / c->factor;
    size_t n = copy_pixels(c), layers = (size_t)c->channels + 1;
    c->light = malloc(n * layers * sizeof *c->light);
    c->veil = malloc(n * layers * sizeof *c->veil);
    c->kind = malloc(3 * n);
    if (!c->light || !c->veil || !c->kind)
        return err_set(e, "flare: out of memory for %dx%d pixels", im->width, im->height);
    c->dark = c->kind + n;
    c->group = c->dark + n;
#pragma omp parallel for schedule(static)
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) copy_pixel(c, j, x, y);
    return 0;
}

/* The copy's veil between its pixels' middles, held beyond the outermost ones. */
static double veil_at(const float *veil, const copy *c, int x, int y)
{
    double u = fmin(fmax((x + 0.5) / c->factor - 0.5, 0), c->width - 1);
    double v = fmin(fmax((y + 0.5) / c->factor - 0.5, 0), c->height - 1);
    int u0 = (int)u, v0 = (int)v, u1 = u0 + (u0 + 1 < c->width), v1 = v0 + (v0 + 1 < c->height);
    const float *a = veil + (size_t)v0 * (size_t)c->width, *b = veil + (size_t)v1 * (size_t)c->width;
    double top = (double)a[u0] + (u - u0) * (double)(a[u1] - a[u0]);
    double low = (double)b[u0] + (u - u0) * (double)(b[u1] - b[u0]);
    return top + (v - v0) * (low - top);
}

/* Negative values (colours beyond the primaries) stay; nothing becomes so. */
static void take_out(job *j, const copy *c, int channel)
{
    const img_info *im = &j->radiance.info;
    const flare_found *f = &j->facts.flare.channel[channel];
    const float *veil = c->veil + (size_t)channel * copy_pixels(c);
    double back = 1 / (1 - f->total);
#pragma omp parallel for schedule(static)
    for (int y = 0; y < im->height; y++)
        for (int x = 0; x < im->width; x++) {
            size_t i = ((size_t)y * (size_t)im->width + (size_t)x) * (size_t)im->channels + (size_t)channel;
            double was = (double)j->radiance.pix[i], here = veil_at(veil, c, x, y);
            j->radiance.pix[i] = (float)(back * (was > 0 ? fmax(was - here, 0) : was));
            if (j->sigma) j->sigma[i] = (float)(back * hypot((double)j->sigma[i], f->error * here));
        }
}

/* Of all channels together, then of each.  A channel that says nothing on its own is believed as all are. */
static int estimate(job *j, copy *c, errmsg *e)
{
    flare_facts *f = &j->facts.flare;
    flare_picture all = picture_of(c, c->channels);
    f->lamps = flare_lamps(c->group, &all, e);
    if (f->lamps < 0 ||
        flare_estimate(&f->all, c->veil + (size_t)c->channels * copy_pixels(c), &all, c->group, NULL, e))
        return -1;
    if (!flare_is_certain(&f->all)) return 0;
    for (int k = 0; k < c->channels; k++) {
        flare_picture p = picture_of(c, k);
        if (flare_estimate(&f->channel[k], c->veil + (size_t)k * copy_pixels(c), &p, c->group, &f->all, e))
            return -1;
        f->channel[k].error = fmax(f->channel[k].error, f->all.error);
    }
    return 0;
}

static void keep_for_header(flare_facts *f, const copy *c)
{
    for (int k = 0; k < c->channels; k++) {
        const flare_found *one = flare_is_certain(&f->all) ? &f->channel[k] : &f->all;
        f->total[k] = flare_is_certain(&f->all) ? (float)one->total : 0;
        f->most[k] = (float)one->most;
        f->error[k] = (float)one->error;
        for (int i = 0; i < f->all.n; i++) f->part[k * f->all.n + i] = (float)one->part[i];
    }
    for (int i = 0; i < f->all.n; i++) f->width[i] = (float)(f->all.sd[i] * c->factor);
}

int job_flare(job *j, errmsg *e)
{
    copy c = {0};
    double t0 = job_cpu_s();
    int bad = copy_init(&c, j, e) || estimate(j, &c, e) ? -1 : 0;
    if (!bad) {
        for (int k = 0; k < c.channels && flare_is_certain(&j->facts.flare.all); k++) take_out(j, &c, k);
        keep_for_header(&j->facts.flare, &c);
    }
    copy_free(&c);
    j->facts.flare_s = job_cpu_s() - t0;
    return bad;
}
