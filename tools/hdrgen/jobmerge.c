/*
 * jobmerge.c - the last stage of a series: all rows through the merge, then what is done to the whole.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "finish.h"
#include "job.h"

/* Deghosting: relative differences up to so many times what is usual in the series are none, within
 * bounds. */
static const double usual_differences = 5, least_tolerance = 0.06, most_tolerance = 0.5;

/* What one thread needs for a row. */
typedef struct bench {
    const uint16_t **at;   /* [n] */
    const uint8_t **gone;  /* [n] */
    float *pedestal;       /* [width * channels] */
    uint64_t *reject;      /* [2 * width] */
    uint8_t *bytes;        /* [2 * width] */
} bench;

static int bench_init(bench *b, const job *j)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t w = (size_t)f->width;
    b->at = malloc(sizeof *b->at * (size_t)j->n);
    b->gone = malloc(sizeof *b->gone * (size_t)j->n);
    b->pedestal = malloc(sizeof *b->pedestal * w * (size_t)f->channels);
    b->reject = malloc(sizeof *b->reject * w * 2);
    b->bytes = malloc(w * 2);
    return b->at && b->gone && b->pedestal && b->reject && b->bytes ? 0 : -1;
}

static void bench_free(bench *b)
{
    free(b->at);
    free(b->gone);
    free(b->pedestal);
    free(b->reject);
    free(b->bytes);
}

/* The picture as merged is RGB, grey, or a mosaic of one value per pixel.  A lane is a set of samples of
 * one channel in a row: first sample, step, number. */
typedef struct lane {
    int channel, first, step, count; /* in pixels; */
    int offset;                      /* in values within a pixel */
} lane;

static int lanes_of_row(lane out[3], const job *j, int y)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int n = 0;
    if (j->opts.has_bayer) {
        for (int p = 0; p < 2 && p < f->width; p++)
            out[n++] = (lane){j->opts.bayer[(y & 1) * 2 + p], p, 2, (f->width - p + 1) / 2, 0};
        return n;
    }
    for (; n < f->channels; n++)
        out[n] = (lane){n, 0, 1, f->width, n};
    return n;
}

/* A strip of the series as frames_next gives it. */
typedef struct strip {
    const uint16_t **codes;  /* [n] */
    const uint8_t **missing; /* [n] */
    uint64_t *votes, *room;  /* [strip rows * width] for deghosting, or NULL */
    int y, rows;
} strip;

static merge_row row_for(const job *j, const lane *l, bench *b, const strip *s, int row)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t ch = (size_t)f->channels, w = (size_t)f->width;
    size_t start = (size_t)l->first * ch + (size_t)l->offset, out = (size_t)(s->y + row) * w * ch + start;
    int any = 0;
    for (int k = 0; k < j->n; k++) {
        b->at[k] = s->codes[k] + (size_t)row * w * ch + start;
        b->gone[k] = s->missing[k] ? s->missing[k] + (size_t)row * w + (size_t)l->first : NULL;
        any |= b->gone[k] != NULL;
    }
    return (merge_row){.codes = b->at, .stride = ch * (size_t)l->step, .count = l->count,
                       .pedestal = j->dark ? b->pedestal + start : NULL,
                       .missing = any ? b->gone : NULL, .missing_stride = (size_t)l->step,
                       .radiance = j->radiance.pix + out, .sigma = j->sigma ? j->sigma + out : NULL,
                       .used = j->count ? b->bytes : NULL, .flags = b->bytes + w,
                       .out_stride = ch * (size_t)l->step};
}

static void fill_pedestal(const job *j, bench *b, int y)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int ch = f->channels;
    const uint16_t *d = j->dark + (size_t)y * (size_t)f->width * (size_t)ch;
    for (int x = 0; x < f->width; x++)
        for (int c = 0; c < ch; c++) {
            int from = j->opts.has_bayer ? j->opts.bayer[(y & 1) * 2 + (x & 1)] : c;
            b->pedestal[x * ch + c] = (float)j->response.finv[from][d[x * ch + c]];
        }
}

/* What contradicts in one channel goes in all. */
static void vote(job *j, const merge *m, const strip *s, int row, bench *b)
{
    int w = frames_get_facts(j->frames)->width;
    uint64_t *votes = s->votes + (size_t)row * (size_t)w;
    lane lanes[3];
    int n = lanes_of_row(lanes, j, s->y + row);
    if (j->dark)
        fill_pedestal(j, b, s->y + row);
    memset(votes, 0, sizeof *votes * (size_t)w);
    for (int l = 0; l < n; l++) {
        merge_row r = row_for(j, &lanes[l], b, s, row);
        merge_find_ghosts(m, lanes[l].channel, &r, votes);
    }
}

static void one_row(job *j, const merge *m, const strip *s, int row, bench *b)
{
    int w = frames_get_facts(j->frames)->width, y = s->y + row;
    size_t out = (size_t)y * (size_t)w;
    lane lanes[3];
    int n = lanes_of_row(lanes, j, y);
    memset(j->flags + out, 0, (size_t)w);
    if (j->count)
        memset(j->count + out, 255, (size_t)w);
    if (j->dark)
        fill_pedestal(j, b, y);
    for (int l = 0; l < n; l++) {
        merge_row r = row_for(j, &lanes[l], b, s, row);
        if (j->opts.deghost && j->opts.has_bayer) {
            memset(b->reject, 0, sizeof *b->reject * (size_t)w);
            merge_find_ghosts(m, lanes[l].channel, &r, b->reject);
            merge_settle_ghosts(m, b->reject, b->reject + w, r.count);
        }
        r.reject = s->votes ? s->votes + (size_t)row * (size_t)w : j->opts.deghost ? b->reject : NULL;
        merge_do_row(m, lanes[l].channel, &r);
        for (int i = 0; i < r.count; i++) {
            size_t x = out + (size_t)(lanes[l].first + i * lanes[l].step);
            j->flags[x] |= r.flags[i];
            if (j->count && r.used[i] < j->count[x])
                j->count[x] = r.used[i];
        }
    }
}

static int allocate(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t pixels = (size_t)f->width * (size_t)f->height;
    if (img_alloc(&j->radiance, f->width, f->height, f->channels, e))
        return -1;
    if (j->opts.want_sigma)
        j->sigma = malloc(pixels * (size_t)f->channels * sizeof *j->sigma);
    if (j->opts.want_count)
        j->count = malloc(pixels);
    j->flags = malloc(pixels);
    if ((j->opts.want_sigma && !j->sigma) || (j->opts.want_count && !j->count) || !j->flags)
        return err_set(e, "out of memory for %dx%d pixels", f->width, f->height);
    return 0;
}

static int all_rows(job *j, const merge *m, strip *s, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int failed = 0;
    s->y = 0;
    for (;;) {
        double t0 = job_cpu_s();
        int rows = s->rows = frames_next(j->frames, s->codes, s->missing, e);
        double t1 = job_cpu_s();
        j->facts.read_s += t1 - t0;
        if (rows <= 0)
            return rows;
#pragma omp parallel
        {
            bench b;
            int bad = bench_init(&b, j);
            if (bad) {
#pragma omp atomic write
                failed = 1;
            }
            if (s->votes) {
#pragma omp for schedule(static)
                for (int row = 0; row < rows; row++)
                    if (!bad)
                        vote(j, m, s, row, &b);
#pragma omp single
                merge_gather_ghosts(m, s->votes, s->room, f->width, rows);
            }
#pragma omp for schedule(static)
            for (int row = 0; row < rows; row++)
                if (!bad)
                    one_row(j, m, s, row, &b);
            bench_free(&b);
        }
        if (failed)
            return err_set(e, "out of memory");
        j->facts.merge_s += job_cpu_s() - t1;
        s->y += rows;
        if (j->progress)
            j->progress("merging", s->y, f->height);
    }
}

/* A picture that must have the size of the series; values as relative light. */
static int load_aside(img *im, const job *j, const char *path, int channels, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    if (img_load(im, path, e))
        return -1;
    if (im->info.width == f->width && im->info.height == f->height &&
        (channels == 0 || (im->info.channels >= 3 ? 3 : 1) == channels))
        return 0;
    err_set(e, "%s: expected %dx%d pixels%s as the series has, found %dx%d", path, f->width, f->height,
            channels == 3 ? " in colour" : channels == 1 ? " in grey" : "", im->info.width, im->info.height);
    img_free(im);
    return -1;
}

static int heal(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t pixels = (size_t)f->width * (size_t)f->height;
    img mask;
    if (load_aside(&mask, j, j->opts.hot, 0, e))
        return -1;
    uint8_t *marked = calloc(pixels, 1);
    int from = mask.info.channels, step = j->opts.has_bayer ? 2 : 1;
    for (size_t i = 0; marked && i < pixels; i++) {
        for (int c = 0; c < (from >= 3 ? 3 : 1); c++)
            marked[i] |= mask.pix[i * (size_t)from + (size_t)c] > 0;
        j->facts.healed += marked[i];
    }
    img_free(&mask);
    if (!marked)
        return err_set(e, "out of memory");
    heal_pixels(j->radiance.pix, f->channels, f->width, f->height, marked, step);
    if (j->sigma)
        heal_pixels(j->sigma, f->channels, f->width, f->height, marked, step);
    free(marked);
    return 0;
}

static int flatten(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int64_t pixels = (int64_t)f->width * f->height;
    int ch = f->channels;
    img flat;
    if (load_aside(&flat, j, j->opts.flat, ch, e))
        return -1;
    int from = flat.info.channels;
    for (int64_t i = 0; i < pixels; i++)
        for (int c = 0; c < ch; c++) {
            float v = flat.pix[i * from + c];
            if (flat.info.coded) { /* codes of the same camera */
                const response *r = &j->response;
                double z = j->opts.bits ? fmin((double)v, r->max_code) : (double)v * r->max_code / flat.info.max_code;
                v = (float)r->finv[j->opts.has_bayer ? 1 : c][(int)(z + 0.5)];
            }
            flat.pix[i * ch + c] = v;
        }
    int bad = apply_flat(j->radiance.pix, j->sigma, flat.pix, ch, pixels, j->opts.flat, e);
    img_free(&flat);
    return bad;
}

static int demosaic(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    img rgb;
    float *sigma = NULL;
    if (img_alloc(&rgb, f->width, f->height, 3, e))
        return -1;
    if (j->sigma) {
        sigma = malloc((size_t)f->width * (size_t)f->height * 3 * sizeof *sigma);
        if (!sigma) {
            img_free(&rgb);
            return err_set(e, "out of memory");
        }
    }
    if (bayer_to_rgb(rgb.pix, sigma, j->radiance.pix, j->sigma, f->width, f->height, j->opts.bayer, e)) {
        img_free(&rgb);
        free(sigma);
        return -1;
    }
    img_free(&j->radiance);
    free(j->sigma);
    j->radiance = rgb;
    j->sigma = sigma;
    return 0;
}

static void scale_all(job *j, double scale)
{
    size_t n = (size_t)j->radiance.info.width * (size_t)j->radiance.info.height * (size_t)j->radiance.info.channels;
    j->facts.scale = scale;
    for (size_t i = 0; i < n; i++) {
        j->radiance.pix[i] = (float)(j->radiance.pix[i] * scale);
        if (j->sigma)
            j->sigma[i] = (float)(j->sigma[i] * scale);
    }
}

/* Saturation-based speed (ISO 12232): the exposure that clips is H = 78/S lx s, and H = 0.65 L t / N^2
 * behind a usual lens,
 * so that L = 120 N^2 / (S t) cd/m2 reaches the highest code.  Radiance 1 does so in the time that
 * job->shots calls exposure. */
static int by_speed(job *j, errmsg *e)
{
    for (int k = 0; k < j->n; k++)
        if (!(j->shots[k].f_number > 0) || !(j->shots[k].iso > 0))
            return err_set(e, "%s: expected f-number and ISO in its EXIF data for --absolute, found none: give --calibrate",
                           j->shots[k].path);
    const shot *s = &j->shots[j->n / 2];
    scale_all(j, 120 * s->f_number * s->f_number / s->iso * s->exposure / s->seconds / 179);
    return 0;
}

static int to_absolute(job *j, errmsg *e)
{
    const double *p = j->opts.patch;
    int w = j->radiance.info.width, h = j->radiance.info.height, ch = j->radiance.info.channels;
    if (p[0] < 0 || p[1] < 0 || p[2] < 1 || p[3] < 1 || p[0] + p[2] > w || p[1] + p[3] > h)
        return err_set(e, "--calibrate: expected a rectangle inside %dx%d pixels, found %g,%g,%g,%g", w, h,
                       p[0], p[1], p[2], p[3]);
    int x = (int)p[0], y = (int)p[1], pw = (int)p[2], ph = (int)p[3];
    for (int i = y; i < y + ph; i++)
        for (int k = x; k < x + pw; k++)
            if (j->flags[(size_t)i * (size_t)w + (size_t)k] & (MERGE_CLIPPED | MERGE_BLACK | MERGE_GAP | MERGE_MISSING))
                return err_set(e, "--calibrate: expected a patch that is neither clipped nor black nor missing, found pixel %d,%d", k, i);
    j->facts.scale = p[4] / patch_luminance(j->radiance.pix, ch, w, x, y, pw, ph);
    if (!(j->facts.scale > 1e-30 && j->facts.scale < 1e30))
        return err_set(e, "--calibrate: expected a patch of positive luminance, found a scale of %g", j->facts.scale);
    scale_all(j, j->facts.scale);
    return 0;
}

static void count_flags(job *j)
{
    size_t pixels = (size_t)j->radiance.info.width * (size_t)j->radiance.info.height;
    for (size_t i = 0; i < pixels; i++) {
        j->facts.clipped += (j->flags[i] & MERGE_CLIPPED) != 0;
        j->facts.black += (j->flags[i] & MERGE_BLACK) != 0;
        j->facts.gap += (j->flags[i] & MERGE_GAP) != 0;
        j->facts.ghosts += (j->flags[i] & MERGE_GHOST) != 0;
        j->facts.missing += (j->flags[i] & MERGE_MISSING) != 0;
    }
}

int job_merge(job *j, errmsg *e)
{
    double t0 = job_cpu_s();
    strip s = {.codes = calloc((size_t)j->n, sizeof *s.codes), .missing = calloc((size_t)j->n, sizeof *s.missing)};
    merge *m = merge_new(&j->response, j->noise, j->exposure, j->n, j->opts.weight, j->dark != NULL, e);
    int bad = -1;
    if (!s.codes || !s.missing)
        err_set(e, "out of memory");
    if (!s.codes || !s.missing || !m || allocate(j, e))
        goto done;
    if (j->opts.deghost && !j->opts.has_bayer) {
        size_t most = (size_t)frames_strip_rows(j->frames) * (size_t)frames_get_facts(j->frames)->width;
        s.votes = malloc(most * sizeof *s.votes);
        s.room = malloc(most * sizeof *s.room);
        if (!s.votes || !s.room) {
            err_set(e, "out of memory");
            goto done;
        }
    }
    merge_set_tolerance(m, fmin(fmax(least_tolerance, usual_differences * j->facts.contradict.usual), most_tolerance));
    j->facts.scale = 1;
    j->facts.merge_s += job_cpu_s() - t0;
    bad = all_rows(j, m, &s, e);
    t0 = job_cpu_s();
    if (!bad && j->opts.hot)
        bad = heal(j, e);
    if (!bad && j->opts.flat)
        bad = flatten(j, e);
    if (!bad && j->opts.has_bayer)
        bad = demosaic(j, e);
    if (!bad && j->opts.patch[2] > 0)
        bad = to_absolute(j, e);
    else if (!bad && j->opts.absolute)
        bad = by_speed(j, e);
    if (!bad)
        count_flags(j);
    j->facts.merge_s += job_cpu_s() - t0;
done:
    free(s.codes);
    free(s.missing);
    free(s.votes);
    free(s.room);
    merge_free(m);
    return bad;
}
