/*
 * develop.c - see develop.h.
 *
 * Camera raw is merged as the sensor saw it; here, once and for the whole series, values s of a pixel become
 * M B s: B the white balance (least multiplier 1, so that 1 is where the first channel clips), M from
 * balanced sensor values to the colour space (rows add up to that space's white).  Variances go through the
 * squares of M B.
 */
#include "develop.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "demosaic.h"
#include "turn.h"

static const double same_balance = 0.005; /* multipliers are equal up to this */

/* ---- white balance ---------------------------------------------------------------------------------------
 */

/* The middle exposure's, which has seen most of the scene well; where it states none, the nearest one's that
 * does. */
static int whose_balance(const job *j)
{
    for (int d = 0; d < j->n; d++)
        for (int side = -1; side <= 1; side += 2) {
            int k = j->n / 2 + side * d;
            if (k >= 0 && k < j->n && frames_sensor(j->frames, k)->balance[0] > 0) return k;
        }
    return -1;
}

int develop_settle(job *j, errmsg *e)
{
    static const double none[3] = {1, 1, 1};
    const sensor_facts *first = frames_sensor(j->frames, 0);
    develop_facts *d = &j->facts.develop;
    d->balance_from = -1;
    d->orientation = frames_info(j->frames, 0)->orientation;
    for (int k = 0; k < j->n; k++)
        d->turns_differ |= frames_info(j->frames, k)->orientation != d->orientation;
    if (!first || (first->channels == 1 && !first->mosaic.columns)) { /* nothing to balance */
        if (j->opts.colour != COLOUR_DEFAULT)
            return err_set(e, "%s: expected camera raw in colour with --colour, found %s", j->shots[0].path,
                           first ? "a grey sensor" : frames_info(j->frames, 0)->format);
        return 0;
    }
    d->camera = first->camera;
    d->balance_from = whose_balance(j);
    const double *b =
        d->balance_from >= 0 ? frames_sensor(j->frames, d->balance_from)->balance : first->daylight;
    d->daylight = d->balance_from < 0 && first->daylight[0] > 0;
    memcpy(d->balance, b[0] > 0 ? b : none, sizeof d->balance);
    for (int k = 0; k < j->n; k++)
        for (int c = 0; c < 3; c++) {
            double other = frames_sensor(j->frames, k)->balance[c];
            double by = other > 0 ? fmax(other / d->balance[c], d->balance[c] / other) - 1 : 0;
            d->balance_differs = fmax(d->balance_differs, d->balance_from >= 0 && by > same_balance ? by : 0);
        }
    if (j->opts.colour == COLOUR_DEFAULT) j->opts.colour = first->has_matrix ? COLOUR_SRGB : COLOUR_CAMERA;
    else if (!first->has_matrix && j->opts.colour != COLOUR_CAMERA)
        return err_set(e,
                       "%s: expected a camera whose colour matrix is known, found %s: give --colour camera",
                       j->shots[0].path, first->camera);
    d->no_matrix = !first->has_matrix;
    return 0;
}

/* ---- mosaic to picture
 * ------------------------------------------------------------------------------------- */

/* What a pixel's photosites were, its colours being made of those around it: any flag, least count.  *whole:
 * all of them were clipped in every exposure. */
static uint8_t gather(uint8_t *count, int *whole, const job *j, int w, int h, int x0, int x1, int y0, int y1)
{
    uint8_t any = 0, least = 255;
    *whole = 1;
    for (int y = y0 < 0 ? 0 : y0; y <= y1 && y < h; y++)
        for (int x = x0 < 0 ? 0 : x0; x <= x1 && x < w; x++) {
            size_t at = (size_t)y * (size_t)w + (size_t)x;
            any |= j->flags[at];
            *whole &= (j->flags[at] & MERGE_CLIPPED) != 0;
            if (j->count && j->count[at] < least) least = j->count[at];
        }
    *count = least;
    return any;
}

enum { ALL_CLIPPED = 128 }; /* in flags, inside this file only */

static int gather_flags(job *j, int w, int h, errmsg *e)
{
    int half = j->opts.half_size, ow = half ? w / 2 : w, oh = half ? h / 2 : h;
    size_t n = (size_t)ow * (size_t)oh;
    uint8_t *flags = malloc(n), *count = j->count ? malloc(n) : NULL;
    if (!flags || (j->count && !count)) {
        free(flags);
        free(count);
        return err_set(e, "out of memory for %dx%d pixels", ow, oh);
    }
#pragma omp parallel for schedule(static)
    for (int y = 0; y < oh; y++)
        for (int x = 0; x < ow; x++) {
            int whole;
            uint8_t least;
            size_t at = (size_t)y * (size_t)ow + (size_t)x;
            flags[at] = half ? gather(&least, &whole, j, w, h, 2 * x, 2 * x + 1, 2 * y, 2 * y + 1)
                             : gather(&least, &whole, j, w, h, x - 1, x + 1, y - 1, y + 1);
            flags[at] |= whole ? ALL_CLIPPED : 0;
            if (count) count[at] = least;
        }
    free(j->flags);
    free(j->count);
    j->flags = flags;
    j->count = count;
    return 0;
}

static int to_colours(job *j, errmsg *e)
{
    int w = j->radiance.info.width, h = j->radiance.info.height, half = j->opts.half_size;
    int ow = half ? w / 2 : w, oh = half ? h / 2 : h;
    img rgb;
    float *sigma = NULL;
    if (gather_flags(j, w, h, e) || img_alloc(&rgb, ow, oh, 3, e)) return -1;
    if (j->sigma) {
        sigma = malloc((size_t)ow * (size_t)oh * 3 * sizeof *sigma);
        if (!sigma) {
            img_free(&rgb);
            return err_set(e, "out of memory for %dx%d pixels", ow, oh);
        }
    }
    int bad = 0;
    if (half) mosaic_half(rgb.pix, sigma, j->radiance.pix, j->sigma, w, h, j->mosaic);
    else bad = demosaic(rgb.pix, sigma, j->radiance.pix, j->sigma, w, h, j->mosaic, e);
    img_free(&j->radiance);
    free(j->sigma);
    j->radiance = rgb;
    j->sigma = sigma;
    return bad;
}

/* ---- sensor values to colours
 * --------------------------------------------------------------------------------- */

/* Where every channel is clipped in every exposure nothing is known of the colour: the brightest white that
 * is no more than any channel's bound. */
static void whiten(float v[3])
{
    float least = fminf(v[0], fminf(v[1], v[2]));
    v[0] = v[1] = v[2] = least;
}

static void balance_and_matrix(job *j)
{
    const double *b = j->facts.develop.balance;
    double m[3][3];
    size_t n = (size_t)j->radiance.info.width * (size_t)j->radiance.info.height;
    long outside = 0;
    colour_matrix(m, j->opts.colour, frames_sensor(j->frames, 0)->matrix);
#pragma omp parallel for schedule(static) reduction(+ : outside)
    for (size_t i = 0; i < n; i++) {
        float *p = j->radiance.pix + 3 * i, v[3], *s = j->sigma ? j->sigma + 3 * i : NULL;
        double sd[3];
        for (int c = 0; c < 3; c++) {
            v[c] = (float)(p[c] * b[c]);
            sd[c] = s ? s[c] * b[c] : 0;
        }
        if (j->flags[i] & ALL_CLIPPED) whiten(v);
        j->flags[i] &= (uint8_t)~ALL_CLIPPED;
        for (int r = 0; r < 3; r++) {
            p[r] = (float)(m[r][0] * v[0] + m[r][1] * v[1] + m[r][2] * v[2]);
            if (s)
                s[r] =
                    (float)sqrt(pow(m[r][0] * sd[0], 2) + pow(m[r][1] * sd[1], 2) + pow(m[r][2] * sd[2], 2));
        }
        float most = fmaxf(p[0], fmaxf(p[1], p[2])), least = fminf(p[0], fminf(p[1], p[2]));
        outside += least < -0.05f * most && !(j->flags[i] & (MERGE_BLACK | MERGE_MISSING));
    }
    j->facts.develop.outside = outside;
}

int job_develop(job *j, errmsg *e)
{
    if (j->mosaic && to_colours(j, e)) return -1;
    if (j->facts.develop.camera) balance_and_matrix(j);
    else
        for (size_t i = 0; i < (size_t)j->radiance.info.width * (size_t)j->radiance.info.height; i++)
            j->flags[i] &= (uint8_t)~ALL_CLIPPED;
    return turn_picture(&j->radiance, j->sigma ? &j->sigma : NULL, &j->flags, j->count ? &j->count : NULL,
                        j->facts.develop.orientation, e);
}
